"""Write the stubs of what the table of shapes decides, from the table; `./run setup` does so, and a test compares."""

import inspect
from pathlib import Path

import jamshape
from jamshape.shapes.constructors import signature_of
from jamshape.shapes.table import SHAPES

FOLDER = Path(jamshape.__file__).parent
NAMES, IMPORT = FOLDER / "__init__.pyi", "from .shapes.named import {0} as {0}\n"

HEADER = '''"""Written by tests/house/stubs.py from the table of shapes."""

from numpy.typing import ArrayLike

from jamshape.shapes.particles import Particles

'''


def stub(shape):
    """Declare the function that makes particles of a shape, an argument a line as the formatter leaves it."""
    signature = signature_of(shape)
    arguments = "".join(f"    {declared(p)},\n" for p in signature.parameters.values())
    return f"def {shape.compiled_name}(\n{arguments}) -> Particles: ...\n".replace("'", "")


def declared(parameter):
    """Declare an argument, without a text that it is by default."""
    is_text = isinstance(parameter.default, str)
    text = str(parameter.replace(default=inspect.Parameter.empty) if is_text else parameter)
    return text + " = ..." * is_text


def stubs():
    """Give the text of each stub by its path."""
    names = sorted(shape.compiled_name for shape in SHAPES.values())
    lines = NAMES.read_text(encoding="utf-8").splitlines(keepends=True)
    others = [line for line in lines if not line.startswith("from .shapes.named ")]
    behind = 1 + max(k for k, line in enumerate(others) if "from ." <= line < IMPORT)
    others[behind:behind] = [IMPORT.format(name) for name in names]
    functions = "".join(map(stub, SHAPES.values()))
    return {NAMES: "".join(others), FOLDER / "shapes/named.pyi": HEADER + functions}


if __name__ == "__main__":
    for path, text in stubs().items():
        path.write_text(text, encoding="utf-8")
