"""The table of agreement, of made-up results."""

import csv
import json
import runpy
from pathlib import Path

import pytest

from common import published

ANALYSIS = Path(__file__).parents[2] / "analysis"
SCRIPT = "agreement.py"
PAPER, YUAN = "marschall_2018", "yuan_2019"


def mean(value, error=0.001, samples=6):
    return {"value": value, "error": error, "samples": samples}


USUAL = {"protocol": "quasistatic"}


RESULTS = {
    "fig05": {
        "phi_J": [
            USUAL | {"alpha": 0, "phi_J": mean(0.8410)},
            USUAL | {"alpha": 1, "phi_J": mean(0.8930)},
            USUAL | {"alpha": 4.0, "phi_J": mean(0.8661, None, 1)},
        ]
    },
    "fig03": {
        "rows": [
            {"alpha": 4, "kappa": 1e-6, "phi_J(kappa)": mean(0.80)},
            {"alpha": 4, "kappa": 1e-8, "phi_J(kappa)": mean(0.865)},
        ]
    },
    "fig08": {
        "conditions": {"n": 200},
        "contact_numbers": [
            USUAL | {"alpha": 1, "z": mean(5.9), "rattlers": mean(0.0, 0.0)},
            USUAL | {"alpha": 0.01, "z": mean(None), "rattlers": mean(8.0, 2.0)},
        ],
        "fits": [USUAL | {"z": {"fit": {"a": 0.30, "a_error": 0.1, "x": 2.0, "x_error": 0.1}}}],
    },
}


@pytest.fixture
def folder(tmp_path):
    """A folder as the workflow leaves it."""
    for name in ("figures", "seconds", "commands", "reports"):
        (tmp_path / name).mkdir()
    for name, result in RESULTS.items():
        (tmp_path / "figures" / f"{name}.json").write_text(json.dumps(result))
    (tmp_path / "figures" / "fig05.png").write_text("a picture")
    for name, seconds in (("rods_alpha4", 60.0), ("fig05", 2.5)):
        (tmp_path / "seconds" / f"{name}.tsv").write_text(f"s\th:m:s\n{seconds}\t0:01:00\n")
    commands = tmp_path / "commands"
    (commands / "rods_alpha4.sh").write_text("jamshape sweep --spherocylinder 4 --out x || true\n")
    (commands / "fig05.sh").write_text(
        'python "$analysis/marschall_2018/fig05_phi_j.py" x --out figures/fig05.png\n'
    )
    (tmp_path / "reports" / "rods_alpha4.json").write_text('{"failed": ["a.h5: it fell apart"]}')
    return tmp_path


@pytest.fixture
def made(folder, report):
    """Return the output, the page, and the rows of the table by quantity."""
    out = folder / "agreement.md"
    said = report(SCRIPT, folder, "--paper", PAPER, "--out", out)
    with (folder / "agreement.csv").open(newline="") as file:
        rows = {row["quantity"]: row for row in csv.DictReader(file)}
    return said, out.read_text(), rows


def test_verdicts(made):
    said, _, rows = made
    assert rows["phi_J, alpha = 0"]["verdict"] == "agrees"
    assert rows["phi_J, alpha = 1 (the peak)"]["verdict"] == "differs"
    assert float(rows["phi_J, alpha = 1 (the peak)"]["difference"]) == pytest.approx(4.92, abs=0.01)
    assert rows["phi_J, alpha = 4"]["verdict"] == "not judged"
    assert rows["phi_J, alpha = 4"]["ours"] == "0.8661"
    assert rows["z, alpha = 0.01"]["verdict"] == "not measured at this scale"
    assert rows["z, alpha = 4"]["ours"] == ""
    assert said["agrees"] + said["differs"] + said["not judged"] < len(rows)
    assert sum(v for name, v in said.items() if name not in ("out", "figures")) == len(rows)


def test_what_is_rare_and_what_is_exact(folder, report):
    counts = {
        "conditions": {"n": 64},
        "contact_numbers": [USUAL | {"alpha": 4, "rattlers": mean(0.0, 0.0)}],
    }
    (folder / "figures" / "fig08.json").write_text(json.dumps(counts))
    assert report(SCRIPT, folder, "--paper", PAPER, "--out", folder / "a.md")["not judged"] == 2
    for on_line, verdict in ((7, "agrees"), (6, "differs")):
        lines = {"on_line": on_line, "packings": 7}
        (folder / "figures" / "fig09b.json").write_text(json.dumps(lines))
        said = report(SCRIPT, folder, "--paper", YUAN, "--out", folder / "a.md")
        assert said[verdict] == 1


def test_values_are_found_where_the_table_says(made):
    _, _, rows = made
    slowest = rows["phi_J(kappa) of the slowest rate here, alpha = 4"]
    assert (slowest["ours"], slowest["verdict"]) == ("0.865", "agrees")
    # A fit has its error beside it, and counts are divided by N.
    assert rows["z - 4 as alpha goes to 0: a"]["our_error"] == "0.1"
    assert rows["z - 4 as alpha goes to 0: exponent x"]["verdict"] == "differs"
    rattlers = rows["rattlers over N, alpha = 0.01"]
    assert (float(rattlers["ours"]), float(rattlers["our_error"])) == (0.04, 0.01)
    assert rows["rattlers over N, alpha = 1"]["verdict"] == "agrees"


def test_the_page_tells_the_rule_the_figures_and_what_was_run(made):
    _, page, _ = made
    assert "by at most 2 joint errors" in page
    assert "![fig05.png](figures/fig05.png)" in page
    assert "| jamshape sweep | 1 | 60 |" in page
    assert "| fig05_phi_j.py | 1 | 2 |" in page
    assert "Not made, or not at rest: a.h5: it fell apart." in page
    assert "| n | 128 |" in page  # of the scale


def test_jobs_are_listed_with_their_commands(made, folder):
    del made
    with (folder / "jobs.csv").open(newline="") as file:
        jobs = {row["job"]: row for row in csv.DictReader(file)}
    assert jobs["rods_alpha4"]["command"].startswith("jamshape sweep")
    assert float(jobs["fig05"]["seconds"]) == 2.5


def test_a_row_that_is_not_one_is_refused(folder, problem):
    rows = RESULTS["fig05"]["phi_J"]
    twice = {"phi_J": [rows[0], rows[0]]}
    (folder / "figures" / "fig05.json").write_text(json.dumps(twice))
    said = problem(SCRIPT, folder, "--paper", PAPER, "--out", folder / "a.md")
    assert "2 rows fit [alpha=0][protocol=quasistatic], expected one" in said


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["--paper", "einstein_1905"], "--paper is 'einstein_1905', expected one of"),
        (["--paper", PAPER, "--scale", "huge"], "--scale is 'huge', expected one of demo, small"),
    ],
)
def test_unknown_names_are_refused(folder, problem, asked, words):
    assert words in problem(SCRIPT, folder, *asked, "--out", folder / "a.md")
    assert not (folder / "a.md").exists()


def test_what_is_no_folder_of_a_reproduction_is_refused(tmp_path, problem):
    said = problem(SCRIPT, tmp_path, "--paper", YUAN, "--out", tmp_path / "a.md")
    assert "has no folder figures, expected one that jamshape reproduce made" in said


def test_a_result_that_was_cut_off_is_refused(folder, problem):
    (folder / "figures" / "fig05.json").write_text('{"phi_J": [')
    said = problem(SCRIPT, folder, "--paper", PAPER, "--out", folder / "a.md")
    assert "fig05.json is not JSON, expected the last line of a figure" in said


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("phi_J,Fig. 5,many,0.1,fig05/a,,", "line 2: value is 'many', expected a number"),
        ("phi_J,Fig. 5,0.8", "line 2: has no error, expected quantity, where, value"),
    ],
)
def test_a_paper_that_cannot_be_read_is_refused(tmp_path, line, words):
    script = runpy.run_path(str(ANALYSIS / SCRIPT))
    paper = tmp_path / "paper.csv"
    paper.write_text(f"quantity,where,value,error,result,per,remark\n{line}\n")
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        script["read_paper"](paper)


def test_numbers_are_those_that_figures_draw():
    """The table has the values of common/published.py."""
    script = runpy.run_path(str(ANALYSIS / SCRIPT))
    rows = {p.result: p for p in script["read_paper"](ANALYSIS / PAPER / "paper.csv")}
    usual = "[protocol=quasistatic]"
    for alpha, known in published.PHI_J.items():
        assert rows[f"fig05/phi_J[alpha={alpha:g}]{usual}/phi_J"].value == known.value
    for alpha, known in published.Z.items():
        assert rows[f"fig08/contact_numbers[alpha={alpha:g}]{usual}/z"].value == known.value
    for alpha, distances in published.DISTANCE.items():
        for u, value in distances.items():
            path = f"fig14_jamming_distance/jamming_distance[alpha={alpha:g}]/distance/{u:g}"
            if u == 1e-15:  # that of all packings
                path = f"fig05/phi_J[alpha={alpha:g}]{usual}/distance"
            assert rows[path].value == value
    for alpha, figure in ((1.0, "fig19a"), (4.0, "fig15a")):
        for band, part in published.BANDS[alpha].items():
            assert rows[f"{figure}/bands[alpha={alpha:g}]/{band}/fraction"].value == part
    for alpha, few in published.RATTLERS.items():
        path = f"fig08/contact_numbers[alpha={alpha:g}]{usual}/rattlers"
        assert rows[path].value == pytest.approx(few / published.N, abs=5e-5)


def test_what_was_not_measured_here_is_taken_from_an_earlier_table(folder, report, tmp_path):
    known = tmp_path / "known"
    known.mkdir()
    header = "quantity,ours,our_error,samples,commit\n"
    rows = '"z, alpha = 0.01",4.43,0.03,6,abc\n"phi_J, alpha = 0",0.5,0.1,2,abc\n'
    (known / "agreement.csv").write_text(header + rows)
    (known / "jobs.csv").write_text("job,seconds,command\nfig05,1.0,old\nfig02,3.0,older\n")
    out = folder / "agreement.md"
    report(SCRIPT, folder, "--paper", PAPER, "--known", known, "--out", out)
    with out.with_suffix(".csv").open(newline="") as file:
        found = {row["quantity"]: row for row in csv.DictReader(file)}
    earlier, here = found["z, alpha = 0.01"], found["phi_J, alpha = 0"]
    assert (earlier["ours"], earlier["verdict"], earlier["commit"]) == ("4.43", "agrees", "abc")
    assert float(here["ours"]) == 0.8410
    assert here["commit"] not in ("", "abc")
    with out.with_name("jobs.csv").open(newline="") as file:
        jobs = {row["job"]: row["seconds"] for row in csv.DictReader(file)}
    assert jobs == {"fig02": "3.0", "fig05": "2.5", "rods_alpha4": "60.0"}


@pytest.mark.parametrize(
    ("value", "verdict"), [(5.64, "agrees as the paper counted"), (5.75, "differs")]
)
def test_a_number_agrees_as_the_paper_counted_only_if_the_other_count_does(value, verdict):
    script = runpy.run_path(str(ANALYSIS / SCRIPT))
    published = script["Published"]
    paper = [
        published("z", "Fig. 8", 5.64, 0.01, "fig08/z", "", "", "z of strong bonds"),
        published("z of strong bonds", "Fig. 8", 5.64, 0.01, "fig08/strong", "", ""),
    ]
    results = {"fig08": {"z": mean(5.97), "strong": mean(value)}}
    first, second = script["rows_of"](results, paper, {})
    assert (first.verdict, first.ours.value) == (verdict, 5.97)
    assert second.verdict == ("agrees" if value == 5.64 else "differs")


def test_the_other_count_must_be_a_row(tmp_path):
    script = runpy.run_path(str(ANALYSIS / SCRIPT))
    paper = tmp_path / "paper.csv"
    header = "quantity,where,value,error,result,per,remark,counted"
    paper.write_text(f"{header}\nz,Fig. 8,5.64,0.01,fig08/z,,,none\n")
    with pytest.raises(ValueError, match="counted is 'none', expected the quantity of another row"):
        script["read_paper"](paper)


def test_a_fraction_of_nothing_is_not_measured():
    script = runpy.run_path(str(ANALYSIS / SCRIPT))
    fraction = script["Published"]("rods", "Abstract", 1.0, 0.0, "onsets/found", "onsets/rods", "")
    assert script["ours_of"]({"onsets": {"found": 0, "rods": 0}}, fraction) is None
    assert script["ours_of"]({"onsets": {"found": 3, "rods": 4}}, fraction).value == 0.75
