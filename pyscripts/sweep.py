"""Make many packings on all cores, several samples for each choice of particles.

    python pyscripts/sweep.py --alpha 0 0.01 1 4 --samples 6 --n 256 --out sweep/

The same as ``jamshape sweep``; --help lists the options.
"""

from jamshape.commands import start

if __name__ == "__main__":
    start("sweep")
