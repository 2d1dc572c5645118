"""Draw packings of any shape, in the plane and in space.

    python analysis/draw.py FILE [MORE ...] [--frame -1] [--color kind] --out packing.png

The same as ``jamshape draw``; --help tells the options.
"""

import sys

try:
    from jamshape.commands import start
except ImportError as error:
    sys.exit(
        f"draw.py: {error} in {sys.executable}, expected a Python with jamshape;"
        " run ./run setup in the repository, then use .venv/bin/python"
    )

if __name__ == "__main__":
    start("draw")
