"""Put the numbers of a reproduced paper beside the paper's, with a verdict on each.

    python analysis/agreement.py FOLDER --paper marschall_2018 --scale demo --out agreement.md

FOLDER is what `jamshape reproduce` makes: figures/ has what the scripts of the figures have said, seconds/ how long
each job took and commands/ what it was. The paper's numbers stand in analysis/PAPER/paper.csv: a quantity, where the
paper has it, its value and error (half of the last digit where the paper tells none), where it is among the results
here, and a remark. `fig05/phi_J[alpha=4]/phi_J` is in fig05.json, under phi_J the row with alpha = 4, of that phi_J; [-1]
is the last row. It is divided by what `per` names. Writes a page, and beside it the same as a table (.csv), the jobs
(jobs.csv) and with what they ran (versions.csv). --known names a folder with earlier tables, of another day or machine:
numbers that are not among the results here, and jobs that did not run here, are taken from them. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import csv
import json
import math
import os
import platform
import re
import shlex
import subprocess
import tomllib
from argparse import Namespace
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import jamshape
from jamshape.checks import require_one_of
from jamshape.command import parser_of, report, run
from jamshape.commands.reproduce import with_samples
from jamshape.lammps.plugin import PluginError, built_for, plugin_path

HERE = Path(__file__).parent
WITHIN = 2.0  # joint errors
AGREES, AS_COUNTED, DIFFERS, UNJUDGED, UNMEASURED = VERDICTS = (
    "agrees", "agrees as the paper counted", "differs", "not judged", "not measured at this scale"
)  # fmt: skip

RULE = f"""\
The joint error is the root of the sum of the squares of both errors; ours is the standard error of the mean over
samples, or that of a fit. Errors stand in brackets, in units of the last digit. The column of joint errors has the
difference of both numbers. A number of ours *{AGREES}* if it differs from the paper's by at most {WITHIN:g} joint errors,
and *{DIFFERS}* if by more; it *{AS_COUNTED}* if it differs, while another row, with the same quantity counted as the
paper did, agrees. What the paper states exactly, with an error of 0, must be the same. A number is *{UNJUDGED}*
where there is no error of ours, as of a single sample, or where what the paper counts was found in no sample. It is
*{UNMEASURED}* where there is no such number. Averages are over all packings; where forces do not balance in some, the
average over the others stands beside it.

Errors know nothing of what another number of particles, rate or protocol changes: at a smaller size than the paper's,
`{DIFFERS}` may mean no more than that, and `{AGREES}` no more than that the errors are large. Errors of a few samples are
uncertain themselves. With {WITHIN:g} joint errors as the bound, about one of twenty numbers differs by chance."""

JOB = ("job", "seconds", "command")
HEADER = ("quantity", "where", "paper", "ours", "samples", "joint errors", "verdict", "remark")


class Published(NamedTuple):
    """A number of a paper."""

    quantity: str
    where: str
    value: float
    error: float
    result: str
    """Path of our value among the results."""
    per: str
    """Path of the divisor of the result; empty for none."""
    remark: str
    counted: str = ""
    """Quantity of the row that counts as the paper did, if this one does not."""


class Ours(NamedTuple):
    """A number that was measured here."""

    value: float
    error: float = math.nan
    """NaN if unknown."""
    samples: int = 0
    """0 if unknown."""
    reached: float = math.nan
    """Value over packings that reached their goal; NaN if all or none did."""
    reached_samples: int | None = None
    """Number of these packings; None if all."""


class Row(NamedTuple):
    """A line of the table."""

    published: Published
    ours: Ours | None
    difference: float
    """Ours minus the paper's in joint errors; NaN if unknown."""
    verdict: str
    commit: str = ""
    """Commit of the code that found our value."""


class Took(NamedTuple):
    """A job, and how long it took."""

    name: str
    seconds: float
    end: float
    """End, in seconds since 1970."""
    command: str

    @property
    def kind(self) -> str:
        """Task: a command of jamshape, or a script."""
        words = shlex.split(self.command.replace("$analysis/", ""))
        scripts = [Path(word).name for word in words if word.endswith(".py")]
        own = f"jamshape {words[words.index('jamshape') + 1]}" if "jamshape" in words else ""
        return scripts[0] if scripts else own or "other"


def read_paper(path: Path) -> list[Published]:
    """Read the numbers of a paper.

    Raises
    ------
    ValueError
        If a column is missing, a value or an error is no number, or `counted` names no row.
    """
    with path.open(newline="", encoding="utf-8") as file:
        found = list(csv.DictReader(file))
    rows, needed = [], [n for n in Published._fields if n not in Published._field_defaults]
    for line, row in enumerate(found, 2):
        if missing := [name for name in needed if row.get(name) is None]:
            msg = f"{path}, line {line}: has no {missing[0]}, expected {', '.join(needed)}"
            raise ValueError(msg)
        numbers: dict[str, Any] = {}
        for name in ("value", "error"):
            try:
                numbers[name] = float(row[name])
            except ValueError:
                msg = f"{path}, line {line}: {name} is {row[name]!r}, expected a number"
                raise ValueError(msg) from None
        told: dict[str, Any] = {name: row[name] for name in Published._fields if name in row}
        rows.append(Published(**told | numbers))
    known = {row.quantity for row in rows}
    if unknown := [row.counted for row in rows if row.counted and row.counted not in known]:
        msg = f"{path}: counted is {unknown[0]!r}, expected the quantity of another row"
        raise ValueError(msg)
    return rows


def read_results(folder: Path) -> dict[str, Any]:
    """Read what the figures have said, by their names.

    Raises
    ------
    ValueError
        If one is not JSON.
    """
    found = {}
    for path in sorted(folder.glob("*.json")):
        try:
            found[path.stem] = json.loads(path.read_text(encoding="utf-8"))
        except json.JSONDecodeError:
            msg = f"{path} is not JSON, expected the last line of a figure; remove it and draw the figure again"
            raise ValueError(msg) from None
    return found


def chosen(rows: Any, asked: Sequence[str]) -> Any:
    """Choose among rows by what stands in brackets; None where no row fits.

    Examples
    --------
    >>> rows = [{"alpha": 1, "z": 5.9}, {"alpha": 4, "z": 5.8}, {"alpha": 4, "z": 5.7}]
    >>> chosen(rows, ["alpha=4", "-1"])
    {'alpha': 4, 'z': 5.7}
    """
    for one in asked:
        name, is_name, value = one.partition("=")
        if is_name:
            rows = [row for row in rows if is_same(row.get(name), value)]
        else:
            rows = rows[int(one)] if -len(rows) <= int(one) < len(rows) else None
        if not rows:
            return None
    if isinstance(rows, list):
        if len(rows) > 1:
            msg = f"{len(rows)} rows fit [{']['.join(asked)}], expected one; name more of it in paper.csv"
            raise ValueError(msg)
        rows = rows[0]
    return rows


def is_same(found: Any, asked: str) -> bool:
    """Whether a value of a result is the one that is asked for; numbers to nine digits."""
    if isinstance(found, int | float):
        return math.isclose(found, float(asked), rel_tol=1e-9)
    return bool(found == asked)


def find(results: Mapping[str, Any], path: str) -> Any:
    """Find a value among the results; None where it is not."""
    at: Any = results
    parent: dict[str, Any] = {}
    last = ""
    for part in path.split("/"):
        name, *asked = re.split(r"\]?\[", part.rstrip("]"))
        if not isinstance(at, Mapping) or at.get(name) is None:
            return None
        parent, last, at = dict(at), name, at[name]
        at = chosen(at, asked) if asked else at
    if isinstance(at, int | float):
        # The error of a fit stands beside its value.
        return {"value": at, "error": parent.get(f"{last}_error")}
    return at


def ours_of(results: Mapping[str, Any], published: Published) -> Ours | None:
    """Find what was measured of a quantity; None where nothing was."""
    found = find(results, published.result)
    if not isinstance(found, Mapping) or found.get("value") is None:
        return None
    unit = find(results, published.per)["value"] if published.per else 1.0
    if not unit:  # a fraction of nothing
        return None
    error = found.get("error")
    error = math.nan if error is None else error / unit
    ours = Ours(found["value"] / unit, error, int(found.get("samples") or 0))
    if isinstance(reached := found.get("reached"), Mapping):
        value = math.nan if reached["value"] is None else reached["value"] / unit
        return ours._replace(reached=value, reached_samples=int(reached["samples"]))
    return ours


def earlier(table: Path) -> dict[str, tuple[Ours, str]]:
    """Read what an earlier table has measured, and by which commit, by the names of quantities."""
    with table.open(newline="", encoding="utf-8") as file:
        return {
            row["quantity"]: (
                Ours(
                    float(row["ours"]),
                    float(row["our_error"] or math.nan),
                    int(row["samples"] or 0),
                    float(row.get("ours_reached") or math.nan),
                    int(at_rest) if (at_rest := row.get("reached_samples")) else None,
                ),
                row["commit"],
            )
            for row in csv.DictReader(file)
            if row["ours"]
        }


def rows_of(
    results: Mapping[str, Any], paper: Sequence[Published], known: Mapping[str, tuple[Ours, str]]
) -> list[Row]:
    """Compare all numbers of a paper with those that were found here, or else earlier."""
    here = commit()
    found = []
    for published in paper:
        ours, made_by = ours_of(results, published), here
        if ours is None:
            ours, made_by = known.get(published.quantity, (None, ""))
        found.append(judged(published, ours)._replace(commit=made_by))
    agreeing = {row.published.quantity for row in found if row.verdict == AGREES}
    return [
        row._replace(verdict=AS_COUNTED)
        if row.verdict == DIFFERS and row.published.counted in agreeing
        else row
        for row in found
    ]


def judged(published: Published, ours: Ours | None) -> Row:
    """Compare two numbers."""
    if ours is None:
        return Row(published, None, math.nan, UNMEASURED)
    off = ours.value - published.value
    if published.error == 0:
        same = math.isclose(ours.value, published.value, rel_tol=1e-9)
        return Row(published, ours, math.nan, AGREES if same else DIFFERS)
    # Of what is rare all samples may have none, which says nothing of its error.
    if not math.isfinite(ours.error) or (ours.value == ours.error == 0 and off):
        return Row(published, ours, math.nan, UNJUDGED)
    difference = off / math.hypot(ours.error, published.error)
    return Row(published, ours, difference, AGREES if abs(difference) <= WITHIN else DIFFERS)


def number(value: float, error: float = math.nan) -> str:
    """Write a number with two digits of its error in brackets, in units of the last digit.

    Examples
    --------
    >>> number(0.841234, 0.0005), number(7.41e-8, 5e-10), number(4), number(10.0, 2.0)
    ('0.84123(50)', '7.410(50)e-08', '4', '10.0(2.0)')
    """
    if not math.isfinite(error) or error == 0:
        return f"{value:.5g}" + (" exactly" if error == 0 else "")
    scale, end = 1.0, ""
    if 0 < abs(value) < 1e-3:
        power = math.floor(math.log10(max(abs(value), error)))
        scale, end = 10.0**power, f"e{power:03d}"
    digits = max(1 - math.floor(math.log10(error / scale)), 0)
    # An error above 1 keeps its point, as 10.0(2.0); others are in units of the last digit.
    told = f"{error / scale:.{digits}f}"
    in_brackets = told if error >= scale else told.replace(".", "").lstrip("0")
    return f"{value / scale:.{digits}f}({in_brackets}){end}"


def cells(row: Row) -> tuple[str, ...]:
    """Write a line of the table."""
    p, ours = row.published, row.ours
    here = number(ours.value, ours.error) if ours else ""
    if ours and ours.reached_samples is not None:
        at_rest = (
            f"{ours.reached:.5g} of {ours.reached_samples}" if ours.reached_samples else "none"
        )
        here += f"; {at_rest} at rest"
    samples = str(ours.samples) if ours and ours.samples else ""
    off = f"{row.difference:+.1f}" if not math.isnan(row.difference) else ""
    return (
        p.quantity,
        p.where,
        number(p.value, p.error),
        here,
        samples,
        off,
        row.verdict,
        p.remark,
    )


def read_jobs(folder: Path) -> list[Took]:
    """Read how long jobs took, and what they were; those without a time are left out."""
    found = []
    for path in sorted((folder / "seconds").glob("*.tsv")):
        command = folder / "commands" / f"{path.stem}.sh"
        text = command.read_text(encoding="utf-8").strip() if command.is_file() else ""
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file, delimiter="\t"):
                took = Took(path.stem, float(row["s"]), path.stat().st_mtime, text)
                found.append(took)
    return found


# What jobs say of packings that could not be made, led to an energy, or have no modes; the others of a job go on.
COMPLAINT = re.compile(r"^(?:jamshape modes: (?!warning: ).+|\S+\.h5: .+)$", re.MULTILINE)


def failures(folder: Path) -> list[str]:
    """List what could not be made, each in a sentence."""
    found = []
    for path in sorted((folder / "reports").glob("*.json")):
        told = json.loads(path.read_text(encoding="utf-8"))
        failed = told.get("failed") if isinstance(told, dict) else None
        found += [str(one) for one in failed] if isinstance(failed, list) else []
    for path in sorted((folder / "logs").glob("*.err")):
        said = path.read_text(encoding="utf-8", errors="replace").replace("\r", "\n")
        found += COMPLAINT.findall(said)
    return list(dict.fromkeys(found))


def markdown(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Write a table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def versions() -> list[tuple[str, str]]:
    """Return the software and hardware that made this page."""
    known = [("jamshape", jamshape.__version__), ("its commit", commit()), ("LAMMPS", lammps())]
    known.append(("Python", platform.python_version()))
    for name in ("numpy", "scipy", "h5py", "snakemake"):
        with suppress(PackageNotFoundError):
            known.append((name, version(name)))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return [*known, ("processor", processor()), ("cores", str(cores))]


def commit() -> str:
    """Name the commit of the clone, with a word where files were changed since."""
    command = ["git", "-C", str(HERE), "describe", "--always", "--dirty=, changed since"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return "not known"
    return done.stdout.strip() or "not known"


def lammps() -> str:
    """Return the LAMMPS version that the plugin was built for."""
    try:
        return str(built_for(plugin_path()))
    except PluginError:
        return "no plugin"


def processor() -> str:
    """Name the processor."""
    told = Path("/proc/cpuinfo")
    text = told.read_text(encoding="utf-8", errors="replace") if told.is_file() else ""
    found = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    return found[1] if found else platform.machine()


def where_it_ran(folder: Path, at: Mapping[str, Any]) -> str:
    """Write the end of the page: sizes, versions and seconds."""
    jobs = read_jobs(folder)
    kinds = Counter(job.kind for job in jobs)
    seconds = {kind: sum(job.seconds for job in jobs if job.kind == kind) for kind in kinds}
    order = sorted(kinds, key=lambda kind: -seconds[kind])
    parts = [markdown(("setting", "value"), [(name, json.dumps(v)) for name, v in at.items()])]
    parts.append(markdown(("on", "version"), versions()))
    rows = [(kind, kinds[kind], f"{seconds[kind]:.0f}") for kind in order]
    if jobs:
        rows.append(("all", len(jobs), f"{sum(seconds.values()):.0f}"))
        elapsed = max(j.end for j in jobs) - min(j.end - j.seconds for j in jobs)
        parts.append(
            "Seconds are those of the clock, of jobs on one core each; of a job that was begun again they are those of"
            f" its last time. From the first job's start to the last one's end, pauses included, it took {elapsed:.0f} s."
        )
    parts.append(markdown(("job", "how many", "seconds"), rows))
    failed = failures(folder)
    parts.append(
        "Not made, or not at rest: "
        + ("; ".join(failed) if failed else "nothing of what was asked for")
        + "."
    )
    return "\n\n".join(parts)


def page(title: str, rows: Sequence[Row], options: Namespace, at: Mapping[str, Any]) -> str:
    """Write the page."""
    counts = Counter(row.verdict for row in rows)
    summary = ", ".join(f"{counts[v]} *{v}*" for v in VERDICTS)
    figures = sorted(path.name for path in (options.folder / "figures").glob("*.png"))
    return "\n\n".join(
        (
            f"# {title}, reproduced at the scale `{options.scale}`",
            f"Verdicts on {len(rows)} numbers of the paper: {summary}.",
            RULE,
            markdown(HEADER, [cells(row) for row in rows]),
            "## Figures",
            "\n".join(f"![{name}](figures/{name})" for name in figures) or "None was drawn.",
            "## What was run where",
            where_it_ran(options.folder, at),
        )
    ) + "\n"  # fmt: skip


def write_tables(out: Path, rows: Sequence[Row], jobs: Sequence[tuple[Any, ...]]) -> None:
    """Write the tables of numbers, of jobs and of versions."""
    ours = ("ours", "our_error", "samples", "difference", "verdict")
    without = ("ours_reached", "reached_samples")
    header = ("quantity", "where", "paper", "paper_error", *ours, "remark", "commit", *without)
    write_table(out.with_suffix(".csv"), header, [plain(row) for row in rows])
    write_table(out.with_name("jobs.csv"), JOB, jobs)
    write_table(out.with_name("versions.csv"), ("on", "version"), versions())


def plain(row: Row) -> tuple[Any, ...]:
    """Write a line of the table for programs; None is an empty cell."""
    p, here, off, verdict, made_by = row
    measured = here or Ours(math.nan)
    told = [*(None if math.isnan(x) else x for x in measured[:2]), measured.samples or None]
    difference = None if math.isnan(off) else f"{off:.3g}"
    cells_of_row = (
        p.quantity,
        p.where,
        p.value,
        p.error,
        *told,
        difference,
        verdict,
        p.remark,
        made_by,
    )
    without = None if math.isnan(measured.reached) else measured.reached
    return (*cells_of_row, without, measured.reached_samples)


def jobs_of(folder: Path, known: Path | None) -> list[tuple[Any, ...]]:
    """List the jobs that ran here, and those that ran earlier and not here, by their names."""
    found: dict[str, tuple[Any, ...]] = {}
    if known:
        with (known / "jobs.csv").open(newline="", encoding="utf-8") as file:
            found = {row[JOB[0]]: tuple(row[name] for name in JOB) for row in csv.DictReader(file)}
    found |= {job.name: (job.name, job.seconds, job.command) for job in read_jobs(folder)}
    return [found[name] for name in sorted(found)]


def write_table(path: Path, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write a table (CSV)."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


TITLES = {
    "vanderwerf_2018": "VanderWerf, Jin, Shattuck & O'Hern, Phys. Rev. E 97, 012909 (2018)",
    "marschall_2018": "Marschall & Teitel, Phys. Rev. E 97, 012905 (2018)",
    "zhang_2021": "Zhang, VanderWerf, Li, Zhang, Shattuck & O'Hern, Phys. Rev. E 104, 014901 (2021)",
    "marschall_shear": "Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002 (2019), and Phys. Rev. E 100, 032906 (2019) and 101, 032901 (2020)",
    "brito_2018": "Brito, Ikeda, Urbani, Wyart & Zamponi, PNAS 115, 11736 (2018)",
    "rocks_hoy_2023": "Rocks & Hoy, Soft Matter (2023)",
    "heussinger_2020": "Heussinger, arXiv 2004.13460 (2020), and others on spherocylinders in 3D",
    "yuan_2019": "Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019)",
}


def main(options: Namespace) -> None:
    """Read, compare, write, report."""
    require_one_of("--paper", options.paper, TITLES)
    scales = tomllib.loads((HERE / options.paper / "scales.toml").read_text(encoding="utf-8"))
    require_one_of("--scale", options.scale, scales)
    figures = options.folder / "figures"
    if not figures.is_dir():
        msg = f"{options.folder} has no folder figures, expected one that jamshape reproduce made"
        raise ValueError(msg)
    results = read_results(figures)
    known = earlier(options.known / "agreement.csv") if options.known else {}
    rows = rows_of(results, read_paper(HERE / options.paper / "paper.csv"), known)
    at = with_samples(scales[options.scale], options.samples)
    text = page(TITLES[options.paper], rows, options, at)
    options.out.write_text(text, encoding="utf-8")
    write_tables(options.out, rows, jobs_of(options.folder, options.known))
    counts = Counter(row.verdict for row in rows)
    verdicts = {name: counts[name] for name in VERDICTS}
    report({"out": options.out, "figures": len(results), **verdicts})


if __name__ == "__main__":
    parser = parser_of(__doc__, "agreement.md")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of jamshape reproduce")
    parser.add_argument("--paper", required=True, help=" or ".join(TITLES))
    parser.add_argument("--scale", default="demo", help="of scales.toml (%(default)s)")
    parser.add_argument("--samples", type=int, help="at most so many of each sort were asked for")
    parser.add_argument("--known", type=Path, metavar="TABLES", help="folder of earlier tables")
    run(parser, main)
