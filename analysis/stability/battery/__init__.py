"""The stability battery: what is stiff or extreme, as cases. Each module imports only what is named before it here.

`case`: a case and its verdict. `scenes/`: extreme packings. `oracle`: second evaluations of contacts, which share
nothing with `lammps_plugin/contact/`. `pairs`, `images`: pairs of bodies one by one, and of packings. `session`:
packings in LAMMPS. `shapes/`: what is tried of each shape, a row each of one table. `parts/`: the cases of each part
of jamshape, for all rows. `cases`: the list of all.

A shape is added by a file of its row in `shapes/`, a line in `shapes/table.py`, and scenes where those of other
shapes do not serve.
"""
