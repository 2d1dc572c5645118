"""Find the modes of a packing: Sec. III D of Marschall & Teitel, PRE 97, 012905.

    python analysis/modes.py PACKING.h5 --out modes.h5

The same as ``jamshape modes``; --help tells the options.
"""

import sys

try:
    from jamshape.commands import start
except ImportError as error:
    sys.exit(
        f"modes.py: {error} in {sys.executable}, expected a Python with jamshape;"
        " run ./run setup in the repository, then use .venv/bin/python"
    )

if __name__ == "__main__":
    start("modes")
