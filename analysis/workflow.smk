# What the workflows of all papers share, for Snakemake (https://snakemake.readthedocs.io). `jamshape reproduce` starts
# them, and the page docs/how-to/reproduce.md tells how; on a cluster one of them is started by itself:
#
#   snakemake -s analysis/marschall_2018/reproduce.smk --directory runs/paper --config scale=full \
#       --executor slurm --jobs 200 --retries 2 --keep-going --rerun-incomplete
#
# A workflow is a list of jobs, each a line of the shell that anybody may type. `scales.toml` beside it says how large
# they are. A job declares to Snakemake what it said (reports/, figures/), and not the packings and runs themselves:
# Snakemake removes what jobs declare when they fail or are to run again, and jamshape goes on from its own files.
import json
import shlex
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

from jamshape.commands import sweep
from jamshape.commands.reproduce import with_samples

ANALYSIS = Path(workflow.basedir).parent
PAPER = Path(workflow.basedir).name
SCALES = tomllib.loads((Path(workflow.basedir) / "scales.toml").read_text())
SCALE = config.get("scale", "demo")
for name in config:
    if name not in ("scale", "samples", "figures"):
        sys.exit(f"{PAPER}/reproduce.smk: the setting {name} is not known, expected scale, samples or figures")
if SCALE not in SCALES:
    sys.exit(f"{PAPER}/reproduce.smk: scale is {SCALE}, expected one of {', '.join(SCALES)}")
SAMPLES = config.get("samples")  # at most so many of each sort
AT = with_samples(SCALES[SCALE], SAMPLES)

# Commands are written as one types them; these words stand for this Python and for the folder of the scripts.
shell.executable("bash")
shell.prefix(
    "export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg"
    f" jamshape_python={shlex.quote(sys.executable)} analysis={shlex.quote(str(ANALYSIS))};"
    ' jamshape() {{ "$jamshape_python" -P -m jamshape "$@"; }};'
    ' python() {{ "$jamshape_python" "$@"; }}; export -f jamshape python; '
)


class Job(NamedTuple):
    """One line of the shell, and which groups of jobs it comes after."""

    command: str
    after: tuple = ()


JOBS, FIGURES, GROUPS = {}, {}, {}


def add(group, name, command, after=()):
    """Add a job whose last line is one JSON object."""
    JOBS[name] = Job(command, tuple(after))
    GROUPS.setdefault(group, []).append(name)


def words(*values):
    """Write options, and lists of them, as words of a command."""
    found = []
    for value in values:
        if isinstance(value, list | tuple):
            found += [words(*value)] * bool(value)
        else:
            found.append(f"{value:g}" if isinstance(value, float) else str(value))
    return " ".join(found)


def add_sweep(group, options, chunk):
    """Add a sweep of packings, a job for each chunk of samples of one sort of particles; return its files.

    A sample that cannot be made is told of in the report of its job, and the others go on.
    """
    out, files = f"packings/{group}", {}
    parsed = sweep.options_of().parse_args([*shlex.split(options), "--out", out])
    numbers = sweep.seeds(parsed)
    for particle in sweep.particles(parsed):
        for first in numbers[::chunk]:
            own = range(first, min(first + chunk, numbers.stop))
            name = f"{group}_{particle.name}_seeds{own.start}to{own.stop - 1}"
            asked = ["--first-seed", own.start, "--samples", len(own), *parsed.extra]
            line = f"jamshape sweep {shlex.join(particle.asked)} {shlex.join(map(str, asked))}"
            add(group, name, f"{line} --jobs 1 --out {out} || true")
            GROUPS.setdefault(f"{group}_{particle.name}", []).append(name)
            made = [sweep.file_of(particle, seed, parsed) for seed in own]
            files[name] = [str(path) for path in made]
            forget_if_gone(name, made)
    return files


def modes_of(files, group, options=""):
    """Write a loop over packings that finds the modes of each that has none yet; what is no minimum has none."""
    modes = f"modes/{group}/$(basename $f .h5).modes.h5"
    return (
        f"mkdir -p modes/{group}; for f in {files}; do if [ $f -nt {modes} ]; then"
        f" jamshape modes $f{options} --out {modes} || true; fi; done;"
        f""" echo '{{"modes": '$(ls modes/{group} | wc -l)'}}'"""
    )


def forget_if_gone(name, packings):
    """Remove a report that tells of more packings than are there.

    Samples that could not be made count as told of: jobs on a cluster, which read this file as well, would else
    remove reports that others wait for.
    """
    said, there = report_of(name), sum(path.exists() for path in packings)
    if said.exists() and json.loads(said.read_text())["made"] > there:
        said.unlink()


def add_modes(group, of, files, options=""):
    """Add the modes of the packings of a sweep, a job for each of its jobs."""
    for name, paths in files.items():
        add(group, f"{group}_{name}", modes_of(shlex.join(paths), group, options), after=[of])


def figure(name, script, inputs, after, *, draws=None):
    """Add a figure; `draws` is for what does not write the picture itself."""
    command = f'python "$analysis/{script}" {words(inputs)}'
    FIGURES[name] = Job(draws or f"{command} --out figures/{name}.png", tuple(after))


def report_of(name):
    """What a job declares to have made: its last line."""
    return Path("reports") / f"{name}.json"


def chosen_figures():
    """Name the figures that are asked for."""
    asked = [name for name in str(config.get("figures", "")).split(",") if name] or list(FIGURES)
    for name in asked:
        if name not in FIGURES:
            sys.exit(f"{PAPER}/reproduce.smk: {name} is no figure, expected some of {', '.join(FIGURES)}")
    return asked


def figure_reports(_):
    """List the last lines of what draws the figures."""
    return [f"figures/{name}.json" for name in chosen_figures()]


def everything(_):
    """List the page, the figures and the reports of all jobs: Snakemake makes what lies before the page again only if asked."""
    needed = [name for figure in chosen_figures() for name in before(FIGURES[figure])]
    names = dict.fromkeys(needed) if config.get("figures") else JOBS
    return ["agreement.md", *figure_reports(None), *(str(report_of(name)) for name in names)]


def before(job):
    """List the jobs before a job, and those before these."""
    direct = [name for group in job.after for name in GROUPS[group]]
    return [earlier for name in direct for earlier in (*before(JOBS[name]), name)]


def needs(jobs):
    """Say which reports a job needs before it."""
    return lambda wildcards: [
        str(report_of(name)) for group in jobs[wildcards.name].after for name in GROUPS[group]
    ]


# What was typed, what it said, and its last line; -e ends a line of several commands at the first that fails.
RUN = (
    "printf '%s\\n' {params.command:q} >commands/{wildcards.name}.sh;"
    " bash -euo pipefail commands/{wildcards.name}.sh >logs/{wildcards.name}.out 2>logs/{wildcards.name}.err"
    " || {{ tail -n 1 logs/{wildcards.name}.err >&2; exit 1; }};"
    " tail -n 1 logs/{wildcards.name}.out >logs/{wildcards.name}.last;"
    " test -s logs/{wildcards.name}.last || {{ tail -n 1 logs/{wildcards.name}.err >&2; exit 1; }};"
    # In one go: a report that a kill left half written would pass for one.
    " mv logs/{wildcards.name}.last {output.said:q}"
)
for folder in ("commands", "logs", "runs", "packings", "figures"):
    Path(folder).mkdir(exist_ok=True)


wildcard_constraints:
    name=r"[^/]+",


rule page:
    input:
        figure_reports,
    output:
        "agreement.md",
        "agreement.csv",
        "jobs.csv",
        "versions.csv",
        directory("samples"),
    params:
        scale=SCALE,
        paper=PAPER,
        samples=f"--samples {SAMPLES}" if SAMPLES else "",
    shell:
        'python "$analysis/sample_tables.py" . --out samples'
        ' && python "$analysis/agreement.py" . --paper {params.paper} --scale {params.scale} {params.samples} --out agreement.md'


rule job:
    input:
        needs(JOBS),
    output:
        said="reports/{name}.json",
    benchmark:
        "seconds/{name}.tsv"
    params:
        command=lambda wildcards: JOBS[wildcards.name].command,
    resources:
        runtime=AT["minutes"],
        mem_mb=AT["mem_mb"],
    shell:
        RUN


rule figure:
    input:
        needs(FIGURES),
    output:
        said="figures/{name}.json",
        picture="figures/{name}.png",
    benchmark:
        "seconds/{name}.tsv"
    params:
        command=lambda wildcards: FIGURES[wildcards.name].command,
    shell:
        RUN
