"""Make a random initial state of particles of any shape without overlaps, for LAMMPS or for Python.

    python pyscripts/make_initial.py --alpha 4 --n 256 --phi 0.4 --out start.data

The same as ``jamshape initial``; --help lists the options.
"""

from jamshape.commands import start

if __name__ == "__main__":
    start("initial")
