"""Every subcommand, tried once on something tiny."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from lammps_runs import QUIET, bare_environment, start_lmp

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.files.lammps_text import read_data
from jamshape.lammps.plugin import PluginError, built_for, loader_lines, plugin_path
from jamshape.vibration.table import read_modes

pytestmark = pytest.mark.lammps


def test_all_reach_their_goals_and_report_where_the_result_is(tiny):
    folder, said = tiny
    for name, ended in said.items():
        assert not ended.code, f"{name}: {ended}"
        assert ended.report["out"] == str(folder / name)


def test_what_they_write_is_what_they_say(tiny):
    folder, said = tiny
    assert read_data(folder / "start.data").phi == pytest.approx(said["start.data"].report["phi"])
    for name, phi in (("run.h5", 0.88), ("slow.h5", 0.64)):
        assert read_packing(folder / name).phi == pytest.approx(phi, rel=1e-3)
        assert read_attributes(folder / name)["finished"]
        assert said[name].report["phi"] == pytest.approx(phi, rel=1e-3)
    assert read_attributes(folder / "packing.h5")["u"] == pytest.approx(1e-6, rel=1e-7)
    assert len(read_modes(folder / "modes.h5")["eigenvalues"]) == said["modes.h5"].report["n_modes"]
    assert (folder / "packing.png").read_bytes().startswith(b"\x89PNG")
    assert said["sweep"].report["made"] == 1
    assert (folder / "sweep" / "alpha1_seed1.h5").is_file()


def test_a_finished_packing_is_not_made_again(tiny, jamshape):
    folder, said = tiny
    before = (folder / "packing.h5").stat().st_mtime_ns
    assert jamshape(*said["packing.h5"].arguments).report == said["packing.h5"].report
    assert (folder / "packing.h5").stat().st_mtime_ns == before


def test_a_packing_that_stops_in_time_is_resumed_by_the_same_command(
    tiny, jamshape, tmp_path, capfd
):
    _, said = tiny
    out = tmp_path / "packing.h5"
    command = (*said["packing.h5"].arguments, "--out", out)
    stopped = jamshape(*command, "--seconds", 0)
    assert (stopped.code, stopped.out, out.exists()) == (75, "", False)
    assert "the same command resumes" in capfd.readouterr().err.strip().splitlines()[-1]
    whole, resumed = said["packing.h5"].report, jamshape(*command).report
    assert resumed == whole | {"out": str(out), "wall_seconds": resumed["wall_seconds"]}


def test_what_does_not_reach_its_goal_ends_with_the_exit_code_1(jamshape, tmp_path, capfd):
    """Forces cannot balance better than rounding lets them."""
    short = ("--n", 8, "--phi-start", 0.5, "--u0", 1e-16, "--tolerance", 1e-14)
    out = tmp_path / "packing.h5"
    said = "the packing is not at rest: it ended stalled, with net forces up to"
    ended = jamshape("pack", "--alpha", 0, *short, "--out", out)
    assert (ended.code, ended.report["reached"], ended.report["outcome"]) == (1, False, "stalled")
    last = capfd.readouterr().err.strip().splitlines()[-1]
    assert last.startswith(f"jamshape pack: warning: {said}")
    assert last.endswith("try a larger --u0 or --tolerance, since rounding leaves more")
    told = jamshape("info", out)
    assert (told.report["reached"], told.code) == (False, None)
    assert "not reached: it ended stalled, with" in told.out
    swept = jamshape("sweep", "--alpha", 0, "--samples", 1, *short, "--out", tmp_path / "sweep")
    counts = [swept.report[name] for name in ("made", "not_made", "not_reached")]
    assert (swept.code, counts) == (1, [1, 0, 1])
    (failed,) = swept.report["failed"]
    assert failed.startswith(f"alpha0_seed1.h5: jamshape pack: warning: {said}")


def test_a_packing_is_the_same_by_any_number_of_threads(tiny, jamshape):
    _, said = tiny
    made = said["packing.h5"]
    assert jamshape(*made.arguments, "--threads", 2).report == made.report
    refused = jamshape(*made.arguments, "--threads", 0).code
    assert (
        refused == "jamshape pack: threads is 0, expected a whole number of threads from 1 to 1024"
    )


def test_what_is_no_run_is_not_gone_on_with(tiny, jamshape):
    folder, said = tiny
    again = jamshape("compress", "--resume", "--out", folder / "slow.h5")
    assert again.report["phi"] == said["slow.h5"].report["phi"]
    refused = jamshape("compress", "--resume", "--out", folder / "packing.h5").code
    assert refused.startswith("jamshape compress: ")
    assert "holds no run, expected" in refused


def interrupted(out, *options):
    """Begin a compression, press Ctrl-C when it can go on from there, and return what it said."""
    command = [sys.executable, "-m", "jamshape", "compress", "--out", str(out), *options]
    pipes = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    # Whoever started the tests may have told them to ignore it.
    heard = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        going = subprocess.Popen(command, **pipes)
    finally:
        signal.signal(signal.SIGINT, heard)
    with going:
        deadline = time.monotonic() + 60
        while not Path(out).exists() and time.monotonic() < deadline:
            time.sleep(0.005)
        # Once may fall into a moment in which Python cannot raise it, such as the end of an object.
        while going.poll() is None and time.monotonic() < deadline:
            going.send_signal(signal.SIGINT)
            time.sleep(1)
        said, complaint = going.communicate()
    assert said == ""
    return going.returncode, complaint


def test_after_ctrl_c_it_is_told_how_to_go_on(jamshape, tmp_path):
    out = tmp_path / "run.h5"
    options = ("--n", "48", "--kappa", "4e-5", "--dt", "0.1", "--phi-end", "0.86", "--rows", "60")
    code, complaint = interrupted(out, *options)
    assert code == 130
    assert "Traceback" not in complaint
    sentence = "jamshape compress: interrupted; the same command resumes from the last checkpoint"
    assert complaint.strip().splitlines()[-1] == sentence
    told = jamshape("info", out)
    assert "compression, not finished" in told.out
    assert told.report["go_on"] == "repeat the command that began it"
    resumed = jamshape("compress", *options, "--out", out)
    assert resumed.report["phi"] == pytest.approx(0.86, abs=1e-3)
    assert jamshape("info", out).report["finished"]


def test_plugin_says_where_it_is_and_how_a_deck_loads_it(jamshape):
    try:
        version = built_for()
    except PluginError as error:
        pytest.skip(str(error))
    ended = jamshape("plugin")
    assert not ended.code
    report = ended.report
    assert report["plugin"] == str(plugin_path())
    assert report["built_for"] == version
    assert f"built for:  LAMMPS {version}" in ended.out
    # The tests run in the LAMMPS that it was built for.
    assert report["module"] == version
    assert "".join(f"    {line}\n" for line in loader_lines()) in ended.out


def test_plugin_path_is_the_path_alone(jamshape):
    assert jamshape("plugin", "--path").out == f"{plugin_path()}\n"


def test_another_lammps_is_told(jamshape, tmp_path, monkeypatch):
    lmp = tmp_path / "lmp"
    lmp.write_text(
        "#!/bin/sh\necho 'Large-scale Atomic/Molecular Massively Parallel Simulator - 2 Aug 2023'\n"
    )
    lmp.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    ended = jamshape("plugin")
    assert ended.report["lmp"] == 20230802
    assert ended.report["agrees"] is False
    assert "the command lmp is LAMMPS 20230802: it does not load" in ended.out


def test_the_lines_of_plugin_load_it_into_lmp(jamshape, tmp_path):
    said = jamshape("plugin").out.split("before the first pair style:")[1]
    lines = [line.strip() for line in said.splitlines() if line.startswith("    ")]
    box = ["region box block 0 9 0 9 -0.5 0.5", "create_box 1 box"]
    deck = ["dimension 2", lines[0], *box, *lines[1:], "pair_style dimer/harmonic"]
    (tmp_path / "own.in").write_text("\n".join(deck) + "\n")
    done = start_lmp(*QUIET, "-in", "own.in", cwd=tmp_path, env=bare_environment())
    assert done.returncode == 0, done.stdout
