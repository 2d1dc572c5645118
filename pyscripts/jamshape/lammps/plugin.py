"""Locations of the compiled plugin and the decks in this installation."""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

PLUGIN_NAME = "jamshape_plugin.so"
ERRORS_NAME = "jamshape_errors.so"
LOADER_NAME = "load_plugin.lmp"

# The version of Debian 12, whose `include` takes its path literally.
_READS_ONCE = 20210929
_QUOTES = ('"', "'")

# Label in the plugin, which cannot be loaded outside LAMMPS.
_LABEL = re.compile(rb"jamshape plugin for LAMMPS (\d+), newest tested (\d+)\0")


class PluginError(RuntimeError):
    """LAMMPS, the compiled plugin or its decks are missing."""


def plugin_path() -> Path:
    """Return the path of the compiled plugin of this installation.

    Raises
    ------
    PluginError
        If the installation has none, because it was built without LAMMPS.

    Examples
    --------
    >>> plugin_path().name
    'jamshape_plugin.so'
    """
    path = _folder_of_binaries() / PLUGIN_NAME
    if not path.is_file():
        msg = (
            f"Found no LAMMPS plugin at {path}, expected one: install a wheel of jamshape that has it, or LAMMPS with its "
            "headers (Debian's lammps, liblammps-dev and python3-lammps) and then jamshape again."
        )
        raise PluginError(msg)
    return path


def errors_path() -> Path | None:
    """Return the path of the library that turns errors of LAMMPS into exceptions; None if LAMMPS raises them itself."""
    path = _folder_of_binaries() / ERRORS_NAME
    return path if path.is_file() else None


def plugin_folder() -> str:
    """Return the folder for LAMMPS_PLUGIN_PATH, where the command `lmp` of the LAMMPS wheel looks for plugins.

    The entry point `lammps.plugins` names this function. It returns an empty text, which adds nothing, if there is no
    plugin or it was built for another LAMMPS; then it prints a warning on standard error, since `lmp` starts nevertheless.

    Examples
    --------
    >>> plugin_folder() in ("", str(plugin_path().parent))  # doctest: +SKIP
    True
    """
    try:
        path, expected = plugin_path(), built_for()
    except PluginError as error:
        print(f"WARNING: {error}", file=sys.stderr)
        return ""
    year, month, day = (int(part) for part in metadata.version("lammps").split(".")[:3])
    found = 10000 * year + 100 * month + day  # the module itself is still being imported
    if found != expected:
        print(
            f"WARNING: Found LAMMPS version {found}, expected {expected} for which {path} was built: install jamshape "
            "again beside this LAMMPS.",
            file=sys.stderr,
        )
        return ""
    return str(path.parent)


def decks_path() -> Path:
    """Return the folder of the input decks of this installation, or of the clone that Python imports.

    Raises
    ------
    PluginError
        If there is none.

    Examples
    --------
    >>> (decks_path() / "compress_spherocylinder.in").is_file()
    True
    """
    installed = _folder_of_binaries() / "inputs"
    cloned = Path(__file__).parents[3] / "inputs"
    for folder in (installed, cloned):
        if (folder / LOADER_NAME).is_file():
            return folder
    msg = f"Found no {LOADER_NAME} in {installed}, expected one: install jamshape again."
    raise PluginError(msg)


def load_script_path() -> Path:
    """Return the path of `load_plugin.lmp`, which a deck includes before its first pair style.

    Raises
    ------
    PluginError
        If there is none.

    Examples
    --------
    >>> load_script_path().name
    'load_plugin.lmp'
    """
    return decks_path() / LOADER_NAME


def loader_lines(folder: Path | None = None, version: int | None = None) -> tuple[str, str]:
    """Return two lines of a deck that load the plugin.

    Parameters
    ----------
    folder
        Folder with ``inputs/load_plugin.lmp``; by default that of this installation.
    version
        Version of the LAMMPS that reads the deck; by default that of the plugin.

    Raises
    ------
    PluginError
        If there is none, or LAMMPS cannot read its path in a deck: in quotes LAMMPS changes non-ASCII letters,
        and a path with both kinds of quotes cannot be written. LAMMPS later than 29Sep2021 parses an unquoted path
        again, so that dollars and a single quote are interpreted.

    Examples
    --------
    >>> loader_lines(Path("/home/you/jamshape"))
    ('variable jamshape index /home/you/jamshape', 'include ${jamshape}/inputs/load_plugin.lmp')
    """
    path = str(folder or decks_path().parent)
    is_plain = path.isascii() and path.isprintable()
    if (version or built_for()) > _READS_ONCE:
        is_plain &= "$" not in path and all(path.count(quote) % 2 == 0 for quote in _QUOTES)
    if is_plain and not set(path) & set(" $#&*%\"'"):
        return f"variable jamshape index {path}", f"include ${{jamshape}}/inputs/{LOADER_NAME}"
    for quote in _QUOTES:
        if is_plain and quote not in path:  # variables are not expanded in quotes
            include = f"include {quote}{path}/inputs/{LOADER_NAME}{quote}"
            return f"variable jamshape index {quote}{path}{quote}", include
    msg = (
        f"Found {path}, which LAMMPS cannot read in a deck, expected a path of ASCII letters with at most one kind of "
        "quotes, in pairs, and no $: move it to another folder."
    )
    raise PluginError(msg)


def built_for(plugin: Path | None = None) -> int:
    """Return the LAMMPS version that a plugin was compiled for, as an integer such as 20210929.

    Parameters
    ----------
    plugin
        Compiled file; by default that of this installation.

    Raises
    ------
    PluginError
        If there is no plugin, or the file is something else.

    Examples
    --------
    >>> built_for() > 20200000
    True
    """
    return int(_label_of(plugin or plugin_path())[1])


def newest_tested() -> int:
    """Return the newest LAMMPS version that the tests of the plugin of this installation have run with.

    Raises
    ------
    PluginError
        If there is no plugin.

    Examples
    --------
    >>> newest_tested() >= 20260704
    True
    """
    return int(_label_of(plugin_path())[2])


def _label_of(path: Path) -> re.Match[bytes]:
    found = _LABEL.search(path.read_bytes())
    if found is None:
        msg = f"Found no label of jamshape in {path}, expected one: install jamshape again."
        raise PluginError(msg)
    return found


def _folder_of_binaries() -> Path:
    from jamshape import _contact  # noqa: PLC0415 - the plugin is installed beside the bindings

    return Path(str(_contact.__file__)).parent
