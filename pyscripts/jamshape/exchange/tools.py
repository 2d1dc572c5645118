"""The packages of other programs, which need not be installed."""

from __future__ import annotations

import importlib
from typing import Any


def tool(module: str, package: str) -> Any:
    """Import a module of another program.

    Raises
    ------
    ImportError
        If it is not installed, or lacks a library of the system.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        msg = f"{module} cannot be imported ({error}), expected it; run pip install '{package}'"
        raise ImportError(msg) from error
