"""Names of files that a shell, a pattern or LAMMPS might take for something else, and that work all the same."""

from __future__ import annotations

import contextlib

import pytest

from jamshape import commands

STRANGE = 'it\'s; a [b] {c} \\d é #&`touch X` ~ ? $HOME * 50% "q"'


def run(*arguments):
    with contextlib.suppress(SystemExit):
        commands.main([str(word) for word in arguments])


@pytest.mark.lammps
@pytest.mark.filterwarnings("ignore")
def test_commands_write_where_they_are_told(tmp_path, monkeypatch):
    folder = tmp_path / STRANGE
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    paths = {end: folder / f"{STRANGE}.{end}" for end in ("h5", "data", "png", "gsd")}
    few = ("--n", 8, "--alpha", 1)
    phi = ("--phi-start", 0.3, "--phi-end", 0.32)
    for _ in range(2):
        run("compress", *few, "--kappa", 1e-2, *phi, "--rows", 20, "--out", paths["h5"])
    run("initial", *few, "--phi", 0.2, "--out", paths["data"])
    run("draw", paths["h5"], "--dpi", 20, "--out", paths["png"])
    run("export", paths["h5"], "--out", paths["gsd"])
    packing = folder / f"{STRANGE} jammed.h5"
    run("pack", *few, "--u0", 1e-8, "--out", packing)
    slow = folder / f"{STRANGE} compressed.h5"
    quick = ("--phi-start", 0.55, "--kappa", 1e-5, "--p-end", 1e-3)
    run("pack", *few, "--u0", 1e-8, "--protocol", "dynamics", *quick, "--out", slow)
    # The run of a packing stays, other energies may be looked for from it.
    assert {path.name for path in folder.iterdir()} == {
        *(path.name for path in paths.values()), packing.name, slow.name, f"{slow.name}.run.h5",
    }  # fmt: skip
    assert [path.name for path in tmp_path.iterdir()] == [STRANGE]
