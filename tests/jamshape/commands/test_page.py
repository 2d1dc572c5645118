"""The commands of pages in docs/how-to, in their order, with options behind them that make them quick."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from jamshape.commands import COMMANDS, sweep

pytestmark = pytest.mark.lammps

ROOT = Path(__file__).parents[3]
PAGES = ROOT / "docs" / "how-to"
PAGE = (PAGES / "command.md").read_text(encoding="utf-8")
OF_COMMAND = re.compile(r"^    jamshape (.*)$", re.MULTILINE)
LINES = OF_COMMAND.findall(PAGE)

SMALL = "--n 16 --phi-start 0.55 --u0 1e-6"
QUICK = {
    "compress": "--alpha 1 --n 16 --kappa 1e-3 --rows 20 --frames 4",
    "pack": f"--alpha 1 {SMALL}",
    "slow": "--alpha 1 --n 16 --phi-start 0.7 --phi-end 0.72 --kappa 1e-6",
    "shear": "--alpha 1 --n 16 --gdot 1e-2 --strain 0.5 --rows 20 --frames 4",
    "aqs": "--alpha 1 --n 16 --step 1e-2 --strain 0.1",
    "sweep": f"--alpha 1 --samples 1 {SMALL}",
    "draw": "--dpi 50",
    "reproduce": "--dry-run",
}


def test_every_command_is_on_the_page():
    assert {line.split()[0] for line in LINES} == set(COMMANDS)
    assert re.findall(r"^\*\*(\w+)\*\* ", PAGE, re.MULTILINE) == list(
        dict.fromkeys(line.split()[0] for line in LINES)
    )


def test_the_commands_of_the_page_run_in_their_order(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for line in LINES:
        name, *options = shlex.split(line)
        out = options[options.index("--out") + 1] if "--out" in options else None
        needed = {".gsd": "gsd", ".ovito": "ovito"}.get(Path(out or "").suffix)
        needed = "snakemake" if name == "reproduce" else needed
        if needed and not importlib.util.find_spec(needed):
            continue
        ended = jamshape(name, *options, *QUICK.get(name, "").split())
        assert not ended.code, f"{line}: {ended}"
        assert out is None or Path(out).exists()


RODS, BALLS = "--n 16 --alpha 1", "--n 16 --delta-phi 0.02 --tolerance 1e-1"
OF_PROTOCOLS = {
    "--search halving": "--u0 1.3e-6 --accuracy 0.1 --tolerance 1e-2",
    "--start": "--u0 1e-6",
    "marschall-2018": f"{RODS} --phi-start 0.55 --kappa 1e-4 --u0 1e-6",
    "yuan-2019-1": f"{BALLS} --phi-start 0.3",
    "yuan-2019-2": f"{BALLS} --phi-start 0.3 --n-sweeps 20",
    "slow": f"{RODS} --phi-start 0.8 --kappa 1e-5 --phi-end 0.95",
}
"""What makes a command quick that has these words; the first that fits."""


def test_the_commands_of_protocols_run_in_their_order(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = OF_COMMAND.findall((PAGES / "protocols.md").read_text(encoding="utf-8"))
    fitting = [next(words for words in OF_PROTOCOLS if words in line) for line in lines]
    assert set(fitting) == set(OF_PROTOCOLS)
    for line, words in zip(lines, fitting, strict=True):
        ended = jamshape(*shlex.split(line), *OF_PROTOCOLS[words].split())
        # The paper's minimiser may end before forces balance as well as ours do.
        may_fail = "--minimiser" in line
        assert not ended.code or (may_fail and ended.code == 1), f"{line}: {ended}"


def test_the_commands_about_particles_run(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (PAGES / "particles.md").read_text(encoding="utf-8")
    lines = OF_COMMAND.findall(page)
    assert len(lines) == 5
    for line in lines:
        words = OF_PROTOCOLS["yuan-2019-1"] if "--protocol" in line else "--n 16 --u0 1e-6"
        ended = jamshape(*shlex.split(line), *words.split())
        assert not ended.code, f"{line}: {ended}"
    run_python(page)


def run_python(page, **shorter):
    """Run the blocks of Python of a page, each as a script of its own, with some of its words replaced."""
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        script = f"import jamshape as js\n{code}"
        for words, quick in shorter.items():
            script = re.sub(rf"\b{words}=[\d.]+", f"{words}={quick}", script)
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", script],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr


SHEAR = (PAGES / "shear.md").read_text(encoding="utf-8")


def test_the_commands_and_lines_of_python_about_shear_run(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    first, steps = OF_COMMAND.findall(SHEAR)
    assert not jamshape(*shlex.split(first), *QUICK["shear"].split()).code
    run_python(SHEAR, n=16, strain=0.5)
    # From the packing that the lines have made.
    assert not jamshape(*shlex.split(steps), "--step", 1e-2).code


def test_the_commands_and_lines_of_python_about_modes_run(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    page = (PAGES / "energies-and-modes.md").read_text(encoding="utf-8")
    for line in OF_COMMAND.findall(page):
        name, *options = shlex.split(line)
        assert not jamshape(name, *options, *({"pack": ["--n", "32"]}.get(name, []))).code
    [ladder] = re.findall(r"^    python (analysis/\S+) (.*)$", page, re.MULTILINE)
    script = [sys.executable, str(ROOT / ladder[0]), *shlex.split(ladder[1])]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(list(Path("ladder").glob("*.h5"))) == 2
    run_python(page)
    assert Path("spectrum.png").exists()


def test_the_commands_of_another_shape_run(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (PAGES / "another-shape.md").read_text(encoding="utf-8")
    lines = [shlex.split(line) for line in OF_COMMAND.findall(page)]
    assert [line[0] for line in lines] == ["pack", "modes", "draw"]
    for name, *options in lines:
        quick = {"pack": ["--n", "16", "--u0", "1e-6"], "draw": ["--dpi", "50"]}.get(name, [])
        assert not jamshape(name, *options, *quick).code


CLUSTER = (PAGES / "cluster.md").read_text(encoding="utf-8")


def test_sweeps_for_snakemake_are_options_of_a_sweep():
    texts = re.findall(r'sweep="([^"]*)"', CLUSTER)
    parsed = [sweep.options_of().parse_args([*shlex.split(text), "--out", "out"]) for text in texts]
    # Each packing has a file of its own.
    for options in parsed:
        files = {
            sweep.file_of(of, seed, options)
            for of in sweep.particles(options)
            for seed in sweep.seeds(options)
        }
        assert len(files) == len(sweep.particles(options)) * options.samples
    assert [options.samples for options in parsed] == [1000, 500, 4]


def test_the_jobs_of_an_array_make_samples_of_their_own(tmp_path):
    [script] = [b for b in re.findall(r"```\n(.*?)```", CLUSTER, re.DOTALL) if "--array" in b]
    jamshape = f"{shlex.quote(sys.executable)} -m jamshape"
    quick = script.rstrip().replace(".venv/bin/jamshape", jamshape)
    quick += f" --samples 1 {SMALL}"
    for job in (0, 9):
        environment = os.environ | {"SLURM_ARRAY_TASK_ID": str(job)}
        subprocess.run(["bash", "-c", quick], cwd=tmp_path, env=environment, check=True)
    names = {path.name for path in (tmp_path / "sweep").glob("*.h5")}
    assert names == {"alpha4_seed1.h5", "alpha4_seed901.h5"}


def test_the_page_of_clusters_says_how_to_look_at_packings(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jamshape("sweep", "--alpha", 1, "--samples", 2, *SMALL.split(), "--out", "sweep")
    (tmp_path / "sweep" / "alpha1_seed1.h5.run.h5").write_text("of a compression")
    [lines] = re.findall(r"```python\n(.*?)```", CLUSTER, re.DOTALL)
    found = {}
    exec(lines, found)  # noqa: S102 - our own page
    assert len(found["phi_J"]) == 2
