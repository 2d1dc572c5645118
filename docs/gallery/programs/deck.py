"""
A LAMMPS deck
=============

The plugin runs in Debian's ``lmp``. This deck compresses rods and writes a data file, which ``js.load`` reads: it contains the shape and
the law of the contacts.
"""

import subprocess
from pathlib import Path

import jamshape as js
from jamshape.lammps.plugin import decks_path

Path("rods.in").write_text("""
dimension     2
atom_style    ellipsoid
include       ${jamshape}/inputs/load_plugin.lmp
create_random spherocylinder 64 0.4 1 type 1 3 1 1 type 1 4.2 1.4 1.4
pair_style    spherocylinder/harmonic sides two
pair_coeff    * * 1.0
fix           squeeze all overdamped/affine drag 1.0 compress 1e-3
timestep      0.1
run           3800
write_data    rods.data
""")
folder = str(decks_path().parent)  # as jamshape plugin --folder prints it
lmp = ["lmp", "-in", "rods.in", "-var", "jamshape", folder]
subprocess.run(lmp, check=True, capture_output=True)
js.plot(js.load("rods.data"), color="orientation")
