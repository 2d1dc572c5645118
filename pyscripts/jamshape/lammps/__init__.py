"""LAMMPS with the plugin loaded."""
