"""Make one mechanically stable packing of any shape: compress, find its energy, measure, store as H5MD.

    python pyscripts/make_packing.py --alpha 4 --n 256 --seed 1 --u0 1e-15 --out packing.h5

The same as ``jamshape pack``; --help lists the options.
"""

from jamshape.commands import start

if __name__ == "__main__":
    start("pack")
