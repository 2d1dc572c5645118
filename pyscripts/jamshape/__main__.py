"""``python -m jamshape``, the same as the command ``jamshape``."""

from jamshape.commands import main

if __name__ == "__main__":
    main()
