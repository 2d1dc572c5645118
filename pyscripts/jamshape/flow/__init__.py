"""Overdamped motion: by LAMMPS, and implicit."""
