"""Make one mechanically stable packing of any shape: compress, find its energy, measure, store as H5MD.

    python pyscripts/make_packing.py --alpha 4 --n 256 --seed 1 --u0 1e-15 --out packing.h5

The same as ``jamshape pack``; --help lists the options.
"""

import sys

try:
    from jamshape.commands import start
except ImportError as error:
    sys.exit(
        f"make_packing.py: {error} in {sys.executable}, expected a Python with jamshape;"
        " run ./run setup in the repository, then use .venv/bin/python"
    )

if __name__ == "__main__":
    start("pack")
