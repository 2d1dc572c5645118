"""What a deck's command ``jamshape WORD`` does: a process beside LAMMPS, with the standard library alone, to start at once."""
