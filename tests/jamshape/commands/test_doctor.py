"""The command `jamshape doctor`, with all that is needed and without some of it."""

from importlib import metadata

import pytest

from jamshape.commands import doctor
from jamshape.lammps.plugin import PluginError, built_for, newest_tested


@pytest.mark.lammps
def test_all_that_is_needed_works_here(jamshape):
    ended = jamshape("doctor")
    assert not ended.code
    assert ended.report["works"] is True
    assert ended.report["numpy"] == metadata.version("numpy")
    assert ended.report["Python module lammps"] == f"LAMMPS {built_for()}"
    assert "NO  " not in ended.out


def test_what_is_missing_comes_with_advice(jamshape, monkeypatch):
    def no_plugin():
        msg = "Found no LAMMPS plugin, expected one: install LAMMPS."
        raise PluginError(msg)

    known = metadata.version
    monkeypatch.setattr(doctor, "plugin_path", no_plugin)
    monkeypatch.setattr(doctor.shutil, "which", lambda _: None)

    def version(name):
        if name == "scipy":
            raise metadata.PackageNotFoundError
        return known(name)

    monkeypatch.setattr(doctor.metadata, "version", version)
    ended = jamshape("doctor")
    assert ended.code == 1
    report = ended.report
    assert report["works"] is False
    assert report["scipy"] is report["plugin"] is report["ffmpeg"] is None
    for line in (
        "NO  scipy            pip install scipy",
        "NO  plugin           Found no LAMMPS plugin, expected one: install LAMMPS.",
        "--  ffmpeg           for movies as MP4; without it they are GIF: install ffmpeg",
    ):
        assert line in ended.out


@pytest.mark.lammps
def test_another_lammps_is_named(jamshape, monkeypatch):
    monkeypatch.setattr(doctor, "version_of_lmp", lambda: 20230802)
    ended = jamshape("doctor")
    assert ended.code == 1
    assert f"lmp                   is LAMMPS 20230802, expected {built_for()}" in ended.out


@pytest.mark.lammps
def test_a_lammps_newer_than_the_tested_ones_is_told(jamshape, monkeypatch):
    monkeypatch.setattr(doctor, "newest_tested", lambda: 20200101)
    ended = jamshape("doctor")
    assert not ended.code
    assert f"for LAMMPS {built_for()}, newer than 20200101, the newest tested at " in ended.out
    assert newest_tested() >= 20260704
