"""Pair styles that are compared: ours and those of LAMMPS, on the same states, one row of a table for each shape."""
