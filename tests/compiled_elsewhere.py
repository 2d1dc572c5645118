"""Plugin of pytest (-p): tests the compiled module that $JAMSHAPE_CONTACT names, not the installed one.

For modules compiled otherwise, such as that of `./run sanitize`.
"""

import importlib.util
import os
import sys

NAME = "jamshape._contact"


def load(path):
    """Import the module of this file before anybody imports the installed one."""
    spec = importlib.util.spec_from_file_location(NAME, path)
    sys.modules[NAME] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])


load(os.environ["JAMSHAPE_CONTACT"])


def pytest_report_header():
    return f"{NAME}: {sys.modules[NAME].__file__}"
