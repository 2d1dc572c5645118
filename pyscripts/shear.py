"""Shear particles of any shape at a constant rate; record stress, order and snapshots in one H5MD file.

    python pyscripts/shear.py --alpha 4 --n 256 --phi 0.8 --gdot 1e-4 --strain 5 --out shear.h5

The same as ``jamshape shear``; --help lists the options.
"""

from jamshape.commands import start

if __name__ == "__main__":
    start("shear")
