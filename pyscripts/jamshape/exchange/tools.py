"""Import of optional packages of other programs."""

from __future__ import annotations

import importlib
from typing import Any


def tool(module: str, package: str) -> Any:
    """Import a module of another program.

    Raises
    ------
    ImportError
        If it is not installed, or lacks a system library.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        msg = f"{module} cannot be imported ({error}), expected it to be installed; run pip install '{package}'"
        raise ImportError(msg) from error
