"""Error against run time of every part of jamshape, in one page.

    python analysis/errors/error_report.py --out runs/error_report
    python analysis/errors/error_report.py --full --out runs/error_report_full

Runs the work-precision study of each part, or takes what is there of an earlier call, and writes report.md: the
command of each study, how long it took, its tables and its picture, the machine and the versions. The short
run, by default, takes minutes, the full one hours. A run that was killed leaves the page of what was done and
goes on when started again. --only names studies, --again repeats them. The last line of standard output is one
JSON object; the exit code is 0 only if no study failed.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any, NamedTuple

from studies.shown import figure_of
from tqdm import tqdm

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.disk import store

ROOT = Path(__file__).resolve().parents[2]
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
OVERVIEW, LEAST_DRAWN = "overview.png", 1e-20
PACKAGES = ("jamshape", "numpy", "scipy", "h5py", "matplotlib")


class Study(NamedTuple):
    """Command lines, first those that prepare; they run in the study's folder. Pictures are patterns there."""

    title: str
    error: str
    """Study with curves: the last JSON line of a script may have `curves` of name, seconds, error."""
    short: list[str]
    full: list[str]
    pictures: list[str]


def rods(n: int, alpha: float = 1.0) -> str:
    """Command line that makes a packing of rods."""
    return f"pyscripts/make_packing.py --alpha {alpha:g} --n {n} --way dynamics --kappa 1e-6 --out rods_{n}.h5"


def spheroids(n: int) -> str:
    """Command line that makes a packing of oblate spheroids."""
    shape = "--shape superellipsoid --w1 0.6"
    return f"pyscripts/make_packing.py {shape} --n {n} --u0 1e-12 --out spheroids_{n}.h5"


SHORT_STIFF = (
    "analysis/errors/stiff_error.py --n 32 --kappas 1e-6 1e-8 --tolerances 1e-2 3e-3 1e-3 3e-4 1e-4"
)
STIFF = "analysis/errors/stiff_error.py --n 128 --tolerances 1e-2 3e-3 1e-3 3e-4 --out ."

STUDIES = {
    "heun": Study(
        "Heun's method: the time step",
        "p, median relative error",
        ["analysis/errors/heun_error.py --n 64 --out ."],
        ["analysis/errors/heun_error.py --out ."],
        ["heun_error.png"],
    ),
    "integrators": Study(
        "Integrators of the fix",
        "p, median relative error",
        ["analysis/errors/integrator_error.py --quick --out ."],
        ["analysis/errors/integrator_error.py --out ."],
        ["integrator_error.png"],
    ),
    "implicit": Study(
        "The implicit integrator of slow compressions",
        "p, median relative error",
        [
            f"{SHORT_STIFF} --phi-from 0.82 --phi-to 0.87 --seconds 20 --out .",
        ],
        [
            f"{STIFF} --alpha 4 --phi-from 0.8 --phi-to 0.9 --kappas 1e-6 1e-8",
            f"{STIFF} --alpha 0.01 --phi-from 0.8 --phi-to 0.88 --kappas 1e-6 1e-8",
            f"{STIFF} --alpha 4 --phi-from 0.8 --phi-to 0.9 --kappas 1e-10 --seconds 600",
        ],
        ["stiff_error_*.png"],
    ),
    "minimisers": Study(
        "Minimisers and energy targets, rods",
        "largest net force / mean bond force",
        ["analysis/errors/minimiser_error.py --n 48 --seconds 2 --states 1 4 --out ."],
        ["analysis/errors/minimiser_error.py --n 256 --seconds 10 --out ."],
        ["minimisers.png"],
    ),
    "minimisers3d": Study(
        "Minimisers and energy targets, spheroids",
        "largest net force / mean bond force",
        [
            spheroids(40),
            "analysis/errors/minimiser_error.py --seconds 2 --states spheroids_40.h5 --out .",
        ],
        [
            spheroids(400),
            "analysis/errors/minimiser_error.py --seconds 60 --states spheroids_400.h5 --out .",
        ],
        ["minimisers.png"],
    ),
    "contact": Study(
        "Contacts of superellipsoids",
        "scale, largest bound of its relative error",
        ["analysis/errors/contact_error.py --pairs 1000 --out ."],
        ["analysis/errors/contact_error.py --out ."],
        ["contact_error.png"],
    ),
    "spectra": Study(
        "Spectra of dynamical matrices",
        "eigenvalues, largest relative error",
        [
            rods(32),
            rods(64),
            "analysis/errors/spectrum_error.py rods_32.h5 rods_64.h5 --tiles 2 4 --out spectrum_error.png",
        ],
        [
            *(rods(n, 4) for n in (64, 256, 1024)),
            "analysis/errors/spectrum_error.py rods_64.h5 rods_256.h5 rods_1024.h5 --tiles 2 6 13 --out spectrum_error.png",
        ],
        ["spectrum_error.png"],
    ),
}


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/error_report")
    found.add_argument("--full", action="store_true", help="the real studies, for hours")
    found.add_argument("--only", nargs="+", choices=STUDIES, default=list(STUDIES))
    found.add_argument("--again", action="store_true", help="repeat what is there")
    return found


def found_by(name: str, options: Namespace) -> dict[str, Any]:
    """Run a study unless its result is there; return its record."""
    folder: Path = options.out / name
    if options.again and folder.exists():
        shutil.rmtree(folder)  # scripts keep what they have finished
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "record.json"
    if record.exists():
        found: dict[str, Any] = json.loads(record.read_text())
        if found["full"] == options.full and not found["failed"]:
            return found
    commands = STUDIES[name].full if options.full else STUDIES[name].short
    found = {"full": options.full, "commands": commands, **run_all(commands, folder)}
    store(record, json.dumps(found, indent=1).encode())
    return found


def run_all(commands: list[str], folder: Path) -> dict[str, Any]:
    """Run the commands of a study up to the first that fails."""
    began, failed = time.perf_counter(), ""
    printed: list[str] = []
    curves: list[dict[str, Any]] = []
    for command in commands:
        text, failed = printed_by(command, folder)
        if failed:
            break
        *tables, numbers = text.strip().splitlines()
        printed += ["\n".join(tables)]
        curves += json.loads(numbers).get("curves", [])
    return {
        "seconds": time.perf_counter() - began,
        "printed": "\n\n".join(filter(None, printed)),
        "curves": curves,
        "failed": failed,
    }


def printed_by(command: str, folder: Path) -> tuple[str, str]:
    """Run a script in a folder: what it printed, and its complaint if it printed nothing.

    Packings say by their exit code whether forces balance; studies of them need not stop there.
    """
    path, *arguments = command.split()
    done = subprocess.run(
        [sys.executable, str(ROOT / path), *arguments],
        check=False,
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | ONE_THREAD,
    )
    if done.returncode == 0 or done.stdout.strip():
        return done.stdout, ""
    said = done.stderr.strip().replace("\r", "\n").splitlines() or ["it said nothing"]
    return "", f"{command}: {said[-1]}"


def draw_curves(axis: Any, curves: list[dict[str, Any]]) -> None:
    """Draw the curves of one study: 'method, case', a colour for each method."""
    from matplotlib.ticker import NullFormatter  # noqa: PLC0415 - not needed for --help

    colours: dict[str, str] = {}
    for curve in curves:
        method = curve["name"].partition(",")[0]
        label = None if method in colours else method
        colour = colours.setdefault(method, f"C{len(colours)}")
        error = [max(e, LEAST_DRAWN) for e in curve["error"]]
        axis.loglog(curve["seconds"], error, ".-", color=colour, lw=0.8, label=label)
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.grid(visible=True, alpha=0.3)
    axis.legend(fontsize=7)


def draw(records: dict[str, dict[str, Any]], path: Path) -> bool:
    """Draw a panel of error against seconds for each study; whether there is one."""
    drawn = {name: found["curves"] for name, found in records.items() if found["curves"]}
    if not drawn:
        return False
    columns = min(len(drawn), 4)
    lines = -(-len(drawn) // columns)
    figure = figure_of(4 * columns, 3.4 * lines)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for axis in axes[len(drawn) :]:
        axis.set_visible(False)
    for axis, (name, curves) in zip(axes, drawn.items(), strict=False):
        draw_curves(axis, curves)
        axis.set_title(STUDIES[name].title, fontsize=9)
        axis.set(xlabel="run time (s)", ylabel=STUDIES[name].error)
    save_figure(figure, path)
    return True


def page(records: dict[str, dict[str, Any]], out: Path) -> str:
    """Write what was done as Markdown."""
    versions = ", ".join(f"{p} {importlib.metadata.version(p)}" for p in PACKAGES)
    lines = [
        "# Error against run time",
        "",
        f"{platform.platform()}, {os.cpu_count()} cores, Python {platform.python_version()}; {versions}.",
        "",
    ]
    if draw(records, out / OVERVIEW):
        lines += [f"![error against run time of every part]({OVERVIEW})", ""]
    for name, found in records.items():
        lines += section(name, found, out)
    return "\n".join(lines)


def section(name: str, found: dict[str, Any], out: Path) -> list[str]:
    """Write what one study did."""
    study = STUDIES[name]
    lines = [f"## {study.title}", ""]
    lines += [f"    .venv/bin/python {command}" for command in found["commands"]]
    lines += ["", f"{found['seconds']:.0f} s; run in the folder `{name}`.", ""]
    if found["failed"]:
        return [*lines, f"**Failed:** {found['failed']}", ""]
    drawn = [path for pattern in study.pictures for path in sorted((out / name).glob(pattern))]
    lines += [f"![{study.title}]({picture.relative_to(out)})" for picture in drawn]
    is_table = found["printed"].lstrip().startswith("|")
    return [*lines, "", found["printed"] if is_table else f"```\n{found['printed']}\n```", ""]


def main(options: Namespace) -> int:
    """Run the studies one after another; return the exit code."""
    options.out.mkdir(parents=True, exist_ok=True)
    records: dict[str, dict[str, Any]] = {}
    for name in tqdm(options.only, unit="study"):
        records[name] = found_by(name, options)
        (options.out / "report.md").write_text(page(records, options.out))
    failed = {name: found["failed"] for name, found in records.items() if found["failed"]}
    seconds = sum(found["seconds"] for found in records.values())
    done = {"out": options.out / "report.md", "studies": list(records)}
    report(done | {"failed": failed, "seconds": seconds})
    return 1 if failed else 0


if __name__ == "__main__":
    run(parser(), main)
