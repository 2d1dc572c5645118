"""The stability battery: what is stiff or extreme, as cases. Each module imports only what stands above it.

`case`: a case and its verdict. `scenes/`: extreme packings, a file for each shape. `oracles`: second evaluations of
contacts, which share nothing with `lammps_plugin/contact/`. `shapes/`: what the battery tries of each shape, one row
of a table. `parts/`: cases of each part of jamshape. `cases`: the list of all.
"""
