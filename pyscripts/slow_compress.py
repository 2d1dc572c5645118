"""Compress particles of any shape through jamming at any rate, however slow; record p(phi).

    python pyscripts/slow_compress.py --alpha 4 --n 256 --kappa 1e-9 --phi-end 0.88 --out slow.h5

The same as ``jamshape slow``; --help lists the options.
"""

from jamshape.commands import start

if __name__ == "__main__":
    start("slow")
