"""The workflows of both papers, as Snakemake plans them; nothing is run, but for one figure that needs no packings."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from in_process import jamshape
from snakemake_runs import run_snakemake
from thinned import in_turn

from jamshape.commands.reproduce import PAPERS, SCALES

pytest.importorskip("snakemake")

ANALYSIS = Path(__file__).parents[2] / "analysis"
FOLDERS = [paper.replace("-", "_") for paper in PAPERS]

# These put numbers beside the paper's and draw nothing.
NO_FIGURES = {"beside_paper.py", "force_gap.py", "grazing_bonds.py"}


def planned(folder, scale, tmp_path):
    """Plan the workflow; return the names of its figures and all that Snakemake says."""
    words = ["--config", f"scale={scale}", "--cores", "1", "-n", "-p"]
    done = run_snakemake(ANALYSIS / folder / "reproduce.smk", tmp_path, *words)
    assert done.returncode == 0, done.stdout
    return set(re.findall(r"output: figures/(\w+)\.json", done.stdout)), done.stdout


def listed(folder):
    """Scripts of a paper in analysis/README.md, with what it says that they draw."""
    [section] = [
        part
        for part in (ANALYSIS / "README.md").read_text().split("\n## ")
        if f"(`{folder}/`)" in part.splitlines()[0]
    ]
    return dict(re.findall(r"^\| `(\w+\.py)` \| (.*) \|$", section, re.MULTILINE))


def labels(text):
    """Figures of the paper that a text names, such as 11a."""
    _, *parts = re.split(r"Figs?\. ", text)
    found = [re.findall(r"(\d+)(?: ?\(?([a-c])\b\)?)?", part) for part in parts]
    return {f"{int(number)}{letter}" for one in found for number, letter in one}


def drawn(names):
    """Figures of the paper that pictures of these names show."""
    found = [re.findall(r"(\d+)([a-c]?)(?=_|$)", name) for name in names]
    return {f"{int(number)}{letter}" for one in found for number, letter in one}


def require_every_figure(folder, names, said):
    """The figures of the list are those that are planned."""
    scripts = listed(folder)
    assert scripts
    assert {
        name for name in scripts if f"{folder}/{name}" not in said
    } == scripts.keys() & NO_FIGURES
    asked = set().union(*map(labels, scripts.values()))
    shown = drawn(names)
    assert {one for one in asked if not any(re.match(rf"{one}[a-c]?$", s) for s in shown)} == set()


@pytest.fixture(scope="module", params=FOLDERS)
def full(request, tmp_path_factory):
    """A paper's folder, the names of all figures at full scale and what Snakemake says."""
    return request.param, *planned(request.param, "full", tmp_path_factory.mktemp("full"))


def test_every_figure_of_the_paper_is_planned_at_full_scale(full):
    require_every_figure(*full)


def test_results_that_the_papers_numbers_are_beside_are_planned(full):
    folder, names, _ = full
    text = (ANALYSIS / folder / "paper.csv").read_text()
    asked = set(re.findall(r"[,\"]([a-z]\w+)/", text))
    assert asked
    assert asked <= names


@pytest.mark.parametrize(
    ("scale", "folder"), in_turn([scale for scale in SCALES if scale != "full"], FOLDERS)
)
def test_every_figure_of_the_paper_is_planned_at_smaller_scales(scale, folder, tmp_path):
    require_every_figure(folder, *planned(folder, scale, tmp_path))


def test_numbers_of_figures_are_read_from_the_list():
    assert labels("Draw densities: Figs. 11(a), 14(a) and 20") == {"11a", "14a", "20"}
    assert labels("Draw: Fig. 9 b and the inset of Fig. 11 b") == {"9b", "11b"}
    assert drawn(["fig08a_11a", "fig11b_inset", "singular_limit"]) == {"8a", "11a", "11b"}


@pytest.mark.parametrize("folder", FOLDERS)
def test_all_scales_have_the_same_keys(folder):
    scales = tomllib.loads((ANALYSIS / folder / "scales.toml").read_text())
    assert tuple(scales) == SCALES
    assert len({tuple(sorted(scale)) for scale in scales.values()}) == 1


NONSENSE = {
    "scale=huge": "reproduce.smk: scale is huge, expected one of demo, small, full",
    "size=3": "reproduce.smk: the setting size is not known, expected scale, samples or figures",
    "figures=fig99": "reproduce.smk: fig99 is no figure, expected some of ",
}


@pytest.mark.parametrize(("setting", "folder"), in_turn([*NONSENSE], FOLDERS))
def test_nonsense_is_refused_before_any_job(setting, folder, tmp_path):
    asked = ["--cores", "1", "-n", "--config", setting]
    done = run_snakemake(ANALYSIS / folder / "reproduce.smk", tmp_path, *asked)
    assert done.returncode != 0
    assert NONSENSE[setting] in done.stdout


def test_a_job_leaves_what_was_typed_what_it_said_and_how_long_it_took(tmp_path):
    asked = (
        ANALYSIS / "yuan_2019" / "reproduce.smk",
        tmp_path,
        "--cores",
        "1",
        "figures/fig02.json",
    )
    done = run_snakemake(*asked)
    assert done.returncode == 0, done.stdout
    assert len(json.loads((tmp_path / "figures" / "fig02.json").read_text())["shapes"]) == 9
    assert (tmp_path / "figures" / "fig02.png").read_bytes().startswith(b"\x89PNG")
    typed = (tmp_path / "commands" / "fig02.sh").read_text()
    assert typed.startswith('python "$analysis/yuan_2019/fig02_shapes.py"')
    assert (tmp_path / "seconds" / "fig02.tsv").exists()
    assert "Nothing to be done" in run_snakemake(*asked).stdout


def listed_jobs(tmp_path, *words):
    """Jobs that the command would run."""
    done = jamshape("reproduce", *words, "--dry-run", "--out", tmp_path / "of a paper")
    assert not done.code
    return set(done.report["planned"])


def test_the_command_lists_its_jobs(tmp_path):
    assert {"fig02", "fig14", "ladder1"} <= listed_jobs(tmp_path, "yuan-2019")


def test_figures_that_are_chosen_come_with_what_they_need_and_with_no_more(tmp_path):
    asked = ("marschall-2018", "--scale", "full", "--samples", "1", "--figures", "fig14b", "fig18b")
    alphas = ("0.01", "1", "4")  # those of the ladders, which both figures read
    packings = {f"rods_alpha{alpha}_seeds1to1" for alpha in alphas}
    ladders = {f"ladder_alpha{alpha}_seed1" for alpha in alphas}
    assert listed_jobs(tmp_path, *asked) == packings | ladders | {"fig14b", "fig18b"}


HEAD = 'include: "../workflow.smk"\n\n\nrule all:\n    input:\n        everything,\n\n\n'


@pytest.fixture
def reproduce(tmp_path):
    """Reproduce by a workflow with these lines, in a clone of its own; return the exit code and what is reported."""
    folder = tmp_path / "analysis" / "yuan_2019"
    folder.mkdir(parents=True)
    scripts = ("workflow.smk", "agreement.py", "sample_tables.py")
    for name in (*scripts, "yuan_2019/scales.toml", "yuan_2019/paper.csv"):
        (tmp_path / "analysis" / name).write_bytes((ANALYSIS / name).read_bytes())
    (tmp_path / "analysis" / "common").symlink_to(ANALYSIS / "common")
    runner = (
        "import sys; from jamshape.commands import main, reproduce\n"
        f"reproduce.workflow_of = lambda paper: reproduce.Path({str(folder / 'reproduce.smk')!r})\n"
        "main(sys.argv[1:])"
    )

    def reproduced(lines):
        (folder / "reproduce.smk").write_text(HEAD + lines)
        done = subprocess.run(
            [sys.executable, "-c", runner, "reproduce", "yuan-2019", "--out", "made"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout, done.stderr
        return done.returncode, json.loads(done.stdout.splitlines()[-1])

    return reproduced


def picture(name):
    """A figure that needs no script."""
    return f"draws=\"echo '{{}}' && echo drawn >figures/{name}.png\""


def test_a_job_that_fails_is_told_and_the_others_go_on(reproduce, tmp_path):
    code, said = reproduce(
        f'figure("fig02", "", (), (), {picture("fig02")})\n'
        'figure("fig99", "", (), (), draws="echo \'fig99: there is none\' >&2; false")\n'
    )
    assert code == 1
    assert said["failed"] == ["fig99: fig99: there is none"]
    assert said["figures"] == 1
    assert said["numbers"].keys() == {"not measured at this scale"}
    assert "![fig02.png](figures/fig02.png)" in (tmp_path / "made" / "agreement.md").read_text()


def test_what_is_there_is_not_made_again_and_what_was_removed_is(reproduce, tmp_path):
    lines = (
        'made = add_sweep("rods", "--alpha 1 --samples 2 --n 16 --phi-start 0.55 --u0 1e-6", 1)\n'
        'add_modes("modes", "rods", made)\n'
        f'figure("fig02", "", (), ["modes"], {picture("fig02")})\n'
    )
    assert reproduce(lines)[0] == 0
    made = tmp_path / "made"
    packings = [made / "packings" / "rods" / f"alpha1_seed{k}.h5" for k in (1, 2)]
    modes = [made / "modes" / "modes" / f"alpha1_seed{k}.modes.h5" for k in (1, 2)]

    def times():
        return [[path.stat().st_mtime_ns for path in paths] for paths in (packings, modes)]

    before = times()
    drawn = (made / "figures" / "fig02.png").stat().st_mtime_ns
    assert reproduce(lines)[0] == 0
    assert (made / "figures" / "fig02.png").stat().st_mtime_ns == drawn
    packings[1].unlink()
    assert reproduce(lines)[0] == 0
    for old, new in zip(before, times(), strict=True):
        assert new[0] == old[0]
        assert new[1] > old[1]
    figure = made / "figures" / "fig02.json"
    figure.unlink()
    assert reproduce(lines)[0] == 0
    assert figure.exists()


def test_a_sample_that_cannot_be_made_is_listed_and_stops_nothing(reproduce, tmp_path):
    # A file of other particles is in its place, which is refused.
    lines = (
        'add_sweep("rods", "--alpha {} --samples 1 --n 16 --phi-start 0.55 --u0 1e-6", 1)\n'
        f'figure("fig02", "", (), ["rods"], {picture("fig02")})\n'
    )
    assert reproduce(lines.replace("{}", "1"))[0] == 0
    folder = tmp_path / "made" / "packings" / "rods"
    (folder / "alpha2_seed1.h5").write_bytes((folder / "alpha1_seed1.h5").read_bytes())
    code, said = reproduce(lines.replace("{}", "2"))
    assert (code, said["failed"]) == (0, [])
    assert (
        "Not made, or not at rest: alpha2_seed1.h5: "
        in (tmp_path / "made" / "agreement.md").read_text()
    )
