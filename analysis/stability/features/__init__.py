"""Features of LAMMPS beside ours: what a row of the table is, and the rows."""
