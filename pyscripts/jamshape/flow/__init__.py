"""Overdamped motion, in LAMMPS and implicit."""
