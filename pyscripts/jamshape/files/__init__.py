"""Reading and writing: H5MD, LAMMPS's text files, sets of files."""
