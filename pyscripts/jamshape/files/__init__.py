"""Reading and writing: H5MD, LAMMPS's text files, ensembles of files."""
