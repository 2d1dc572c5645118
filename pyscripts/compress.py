"""Compress particles of any shape through jamming; record p(phi) and snapshots in one H5MD file.

    python pyscripts/compress.py --alpha 4 --n 1024 --kappa 1e-6 --phi-start 0.4 --phi-end 0.9 --out run.h5

The same as ``jamshape compress``; --help lists the options.
"""

from jamshape.commands import start

if __name__ == "__main__":
    start("compress")
