"""LAMMPS with the plugin loaded."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from jamshape.arguments import checked
from jamshape.checks import require_one_process
from jamshape.files.lammps_text import write_data
from jamshape.lammps.module import (
    LammpsError,
    info,
    lammps_class,
    one_at_a_time,
    require_open,
    run_command,
    separate_commands,
    start_lammps,
)
from jamshape.lammps.plugin import PluginError, built_for, plugin_path
from jamshape.packing import Box, Packing, angle_from_quaternion
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import guess_shape_style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from jamshape.arrays import FloatArray, IntArray

# Styles need a dimension and an atom style before the state; a restart file contains both.
_ATOMS = "units lj\natom_style ellipsoid\natom_modify map array"
_POSES = """compute orient all property/atom quatw quati quatj quatk
            compute shape all property/atom shapex shapey shapez"""

# Skin, over the smallest diameter.
_SKIN = 0.3
_WIDEST_BIN = 50.0


# A line of `info dumps`.
_DUMP = re.compile(r"Dump\[ *\d+\]: +(\S+), +file = (.*), +style = ")


# Variables by which Open MPI detects a process started by srun.
_STEP = ("SLURM_STEP_ID", "SLURM_STEPID")

# Open MPI 4 crashes if the name of its temporary folder has other characters.
_PLAIN_NAME = re.compile(r"[\w./+-]*", re.ASCII)


@contextmanager
def _as_one_process() -> Iterator[None]:
    """Hide from MPI, while it starts, variables that would abort it.

    Open MPI aborts a single-process step started by Slurm's srun, as Snakemake's jobs are, unless srun also
    provides PMI (PMIX_RANK); here it is not needed.
    """
    names: tuple[str, ...] = ()
    if os.environ.get("SLURM_STEP_NUM_TASKS") == "1" and "PMIX_RANK" not in os.environ:
        names = _STEP
    if not _PLAIN_NAME.fullmatch(os.environ.get("TMPDIR", "")):
        names = (*names, "TMPDIR")
    hidden = {name: os.environ.pop(name) for name in names if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(hidden)


def _in_memory() -> BinaryIO:
    """Open a file without a name, for LAMMPS to read or write through its descriptor."""
    return open(os.memfd_create("restart"), "w+b")  # noqa: PTH123 - a descriptor


def _without_dumps(lmp: Any) -> LammpsError:
    """Remove dumps whose file cannot be opened, which LAMMPS would crash on writing; return an error that names them."""
    dumps = dict(_DUMP.findall("\n".join(info(lmp, "dumps"))))
    unwritable = {name: file for name, file in dumps.items() if not _is_writable(Path(file))}
    removed = unwritable or dumps
    for name in removed:
        run_command(lmp, f"undump {name}")
    named = ", ".join(f"{name} ({file})" for name, file in removed.items())
    return LammpsError(
        f"found a dump whose file cannot be opened, expected a path that can be written; removed {named}: repeat the command"
        " dump with another path"
    )


def _is_writable(path: Path) -> bool:
    """Return whether a file can be opened for writing."""
    return not path.is_dir() and os.access(path if path.exists() else path.parent, os.W_OK)


class Session:
    """A LAMMPS instance with our styles; a context manager.

    Raises
    ------
    PluginError
        If there is no LAMMPS, or no plugin for it.
    RuntimeError
        If mpirun or srun started several processes.
    OSError
        If the log cannot be written.

    Parameters
    ----------
    log
        Log file; None for none.
    screen
        Whether LAMMPS writes to standard output.
    arguments
        Further command-line arguments of `lmp`, such as ``("-var", "alpha", "4")``.

    Notes
    -----
    An error in a command raises `LammpsError`, even where LAMMPS itself would end the process. Without `screen`, warnings
    still reach standard error, through a filter that outlives the process. Threads take turns, command by command.

    Examples
    --------
    >>> import jamshape as js
    >>> from jamshape.protocols.random_start import random_packing
    >>> with js.Session() as session:
    ...     session.load(random_packing(n=8, phi=0.3, seed=1))
    ...     session.interact(js.Interaction(k_e=2.0, sides=2))
    ...     session.commands("fix squeeze all overdamped/affine drag 1.0 compress 1e-3")
    ...     session.commands("run 10")
    ...     js.load(session).phi > 0.3
    True
    """

    def __init__(
        self, log: str | Path | None = None, *, screen: bool = False, arguments: Sequence[str] = ()
    ) -> None:
        lammps_class()  # reports missing parts before anything is started
        require_one_process(
            "they would share each run, and each make its own copy of the result",
            ", or give mpirun the command lmp and a deck",
        )
        if log:
            Path(log).open("a").close()  # LAMMPS would end the process on failure
        self._like: Packing | None = None
        self._law: Interaction | None = None
        plugin = plugin_path()
        options = ["-nocite", "-log", str(log) if log else "none"]
        self._complaints: subprocess.Popen[bytes] | None = None
        if not screen:
            self._complaints = subprocess.Popen(
                ["sed", "-u", "-n", "-E", "/^(ERROR|WARNING)/p"], stdin=subprocess.PIPE, stdout=2
            )
            assert self._complaints.stdin is not None
            options += ["-screen", f"/dev/fd/{self._complaints.stdin.fileno()}"]
        try:
            with one_at_a_time(), _as_one_process():
                self._lmp = start_lammps([*options, *arguments])
        except BaseException:
            self._end_complaints()
            raise
        with one_at_a_time():
            self._library = self._load(plugin)

    def __enter__(self) -> Self:
        return self

    def __reduce__(self) -> NoReturn:
        msg = "a Session holds a running LAMMPS, which cannot be pickled or copied; take its packing, session.packing()"
        raise TypeError(msg)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the instance."""
        with one_at_a_time():
            self._lmp.close()
        self._end_complaints()

    def _end_complaints(self) -> None:
        if self._complaints:
            self._complaints.communicate()

    def _load(self, plugin: Path) -> ctypes.CDLL:
        """Load our styles, after checking that they were built for this LAMMPS."""
        try:
            library = self._checked(plugin)
        except PluginError:
            self.close()
            raise
        for name in ("register", "register_again", "mend"):
            getattr(library, f"jamshape_{name}").argtypes = [ctypes.c_void_p]
        library.jamshape_register(self.lmp.lmp)
        return library

    def _checked(self, plugin: Path) -> ctypes.CDLL:
        again = "install jamshape again beside this LAMMPS"
        found, expected = self.version, built_for(plugin)
        if found != expected:
            msg = f"Found LAMMPS version {found}, expected {expected} for which {plugin} was built: {again}."
            raise PluginError(msg)
        try:
            library = ctypes.CDLL(str(plugin))
        except OSError as error:
            msg = f"Found a plugin that this LAMMPS cannot load ({error}), expected one built for it: {again}."
            raise PluginError(msg) from error
        library.jamshape_differs.argtypes = [ctypes.c_void_p]
        library.jamshape_differs.restype = ctypes.c_char_p
        wrong = library.jamshape_differs(self.lmp.lmp).decode()
        if wrong:
            raise PluginError(wrong)
        return library

    @property
    def lmp(self) -> Any:
        """The object ``lammps.lammps``; a ValueError if the session is closed."""
        return require_open(self._lmp, "session", "js.Session()")

    @checked
    def commands(self, text: str) -> None:
        """Run LAMMPS input, one command a line; a final ``&`` and triple quotes continue it on the next line.

        Raises
        ------
        LammpsError
            If LAMMPS refuses one. The session remains usable, without the pair style or fix that the command would have
            replaced, with the default thermo style, and without dumps whose file cannot be opened.
        ValueError
            If the session is closed.
        """
        for command in separate_commands(text):
            with one_at_a_time():
                self._run(command)

    def _run(self, command: str) -> None:
        lmp = self.lmp
        try:
            run_command(lmp, command)
        except LammpsError as error:
            self._library.jamshape_mend(lmp.lmp)
            if "annot open dump file" in str(error):
                raise _without_dumps(lmp) from error
            raise
        finally:
            # After `clear`, which may also come within a deck.
            self._library.jamshape_register_again(lmp.lmp)
            if not lmp.extract_setting("box_exist"):
                self._like = self._law = None

    def left_out(self) -> str:
        """Return the log's note on calculations skipped in the last run."""
        function = self._library.jamshape_left_out
        function.argtypes, function.restype = [ctypes.c_void_p], ctypes.c_char_p
        return str(function(self.lmp.lmp).decode())

    @checked
    def load(self, packing: Packing) -> None:
        """Load a packing into a fresh instance; LAMMPS types are those of `Shape.style`, its IDs 1 to N.

        Raises
        ------
        ValueError
            If the instance has a simulation box already.
        """
        self._require_no_box()
        self.commands(f"{_ATOMS}\ndimension {packing.dimension}")
        one = packing.with_(law=Interaction())  # set by `interact`
        types = one.shape.style(one, one.law).types
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "start.data"
            rank = 1 + np.argsort(np.argsort(packing.id))
            write_data(path, one.with_(species=types, id=rank))
            if packing.box.is_tilted:
                self.commands("box tilt large")
            # Through a descriptor, since LAMMPS interprets `$`, `*` and quotes in names.
            with path.open("rb") as file:
                self.commands(f"read_data /dev/fd/{file.fileno()}")
        self.commands(_POSES)
        self._like = packing

    def _require_no_box(self) -> None:
        if self.lmp.extract_setting("box_exist"):
            msg = (
                "the session has a simulation box already, expected none; run commands('clear') first, or set another state of"
                " the same particles with packing.to_lammps(session)"
            )
            raise ValueError(msg)

    def load_restart(self, restart: bytes, like: Packing | None = None) -> None:
        """Load the content of a restart file into a fresh instance, with the particles of a packing."""
        self._require_no_box()
        with _in_memory() as file:
            file.write(restart)
            file.flush()
            self.commands(f"{_ATOMS}\nread_restart /dev/fd/{file.fileno()}\n{_POSES}")
        self._like = like

    def restart(self) -> bytes:
        """Return the content of a restart file of the present state, which LAMMPS wraps and sorts."""
        # In memory: on a full disk LAMMPS would end this process.
        with _in_memory() as file:
            self.commands(f"write_restart /dev/fd/{file.fileno()}")
            file.seek(0)
            return file.read()

    @checked
    def interact(self, law: Interaction) -> None:
        """Set the pair style of the loaded particles; packings carry this law from then on."""
        self.commands(self._loaded.shape.style(self._loaded, law).commands)
        self._law = law

    @property
    def _loaded(self) -> Packing:
        if self._like is None:
            msg = "no packing was loaded, expected one (Session.load) before this"
            raise ValueError(msg)
        return self._like

    def packing(self, time: float = 0.0) -> Packing:
        """Return the present state, sorted by ID, with a given time.

        Shapes, forms and species are those of the loaded packing; without one, shapes are
        guessed from diameters, as for files.
        """
        with one_at_a_time():
            return self._packing(time)

    def _packing(self, time: float) -> Packing:
        lmp = self.lmp
        n = lmp.get_natoms()
        lo, hi, xy, yz, xz, *_ = lmp.extract_box()
        d = int(lmp.extract_setting("dimension"))

        def rows(name: str, kind: int, width: int) -> NDArray[Any]:
            return np.array(lmp.gather(name, kind, width)).reshape(n, width)

        quaternion, diameters = rows("c_orient", 1, 4), rows("c_shape", 1, 3)
        return Packing(
            position=rows("x", 1, 3)[:, :d],
            orientation=angle_from_quaternion(quaternion) if d == 2 else quaternion,
            diameters=diameters,
            **self._known(diameters, rows("type", 0, 1)[:, 0]),
            image=rows("image", 0, 3)[:, :d],
            box=Box(
                np.array(lo[:d]),
                np.array(hi[:d]) - np.array(lo[:d]),
                np.array([xy] if d == 2 else [xy, xz, yz]),
            ),
            step=self.step,
            time=time,
        )

    def _known(self, diameters: FloatArray, types: IntArray) -> dict[str, Any]:
        """Return properties that LAMMPS does not store of its particles."""
        if self._like is None:
            known = {"shape_style": guess_shape_style(diameters), "species": types}
            return known | {"id": np.arange(1, len(types) + 1)}
        like = self._like.sorted_by_id()
        names = ("shape_style", "form", "species", "id")
        return {name: getattr(like, name) for name in names} | {"law": self._law or like.law}

    def neighbours(self) -> str:
        """Return input that sets up the neighbour list in the particles' unit of length."""
        diameters = self.packing().diameters
        # Bins of a plane, which is one unit thick, may be at most a hundred times wider.
        style = "bin" if diameters.max() < _WIDEST_BIN else "nsq"
        skin = _SKIN * float(diameters.min())
        return (
            f"neighbor {skin!r} {style}\n"
            "neigh_modify every 1 delay 0 check yes one 10000 page 1000000"
        )

    @property
    def is_tilted(self) -> bool:
        """Whether the box may tilt (triclinic in LAMMPS)."""
        return bool(self.lmp.extract_setting("triclinic"))

    @property
    def version(self) -> int:
        """LAMMPS version, such as 20210929."""
        return int(self.lmp.version())

    @property
    def step(self) -> int:
        """The current time step."""
        return int(self.lmp.extract_global("ntimestep"))
