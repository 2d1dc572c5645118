# The sweep on a cluster, with Snakemake (https://snakemake.readthedocs.io), which knows the batch systems. The page
# docs/how-to/cluster.md tells how to install it, and what happens when jobs die:
#
#   snakemake -s pyscripts/sweep.smk --config out=sweep sweep="--alpha 0 0.01 1 4 --samples 6 --n 256" \
#       --executor slurm --jobs 200 --default-resources slurm_partition=short slurm_account=physics \
#       --retries 2 --keep-going --rerun-incomplete
#
# `sweep` holds the options of `jamshape sweep`, of any shape; `chunk` is how many samples a job makes (1), `cores` on
# how many cores (1), `minutes` for how long at most (60), and `mem_mb` its memory (1000). With --cores 2 in place of
# --executor and what is behind it, the jobs run here.
import shlex
import sys
from pathlib import Path

from jamshape.commands import sweep

SETTINGS = ("out", "sweep", "chunk", "cores", "minutes", "mem_mb")

for name in config:
    if name not in SETTINGS:
        sys.exit(
            f"sweep.smk: the setting {name} is not known, expected {', '.join(SETTINGS)};"
            ' give options of jamshape sweep in one text, such as sweep="--alpha 4 --samples 6"'
        )


def count(name, usual):
    """Read a setting that counts something."""
    text = str(config.get(name, usual))
    if not text.isdecimal() or int(text) < 1:
        sys.exit(f"sweep.smk: {name} is {text}, expected a whole number of at least 1")
    return int(text)


OUT = str(config.get("out", "sweep"))
CHUNK, CORES = count("chunk", 1), count("cores", 1)
PARSER = sweep.options_of()
PARSER.prog = "sweep.smk"
OPTIONS = PARSER.parse_args([*shlex.split(str(config.get("sweep", ""))), "--out", OUT])


def jobs():
    """List what each job is asked for, by its name: a chunk of samples of one kind of particles."""
    found, seeds = {}, sweep.seeds(OPTIONS)
    for first in seeds[::CHUNK]:
        own = range(first, min(first + CHUNK, seeds.stop))
        for particle in sweep.particles(OPTIONS):
            asked = ["--first-seed", own.start, "--samples", len(own), *OPTIONS.extra]
            name = f"{particle.name}_seeds{own.start}to{own.stop - 1}"
            found[name] = particle, own, shlex.join(map(str, [*particle.asked, *asked]))
    return found


JOBS = jobs()


def report_of(name):
    """What a job declares to have made: the last line of its sweep, not the packings.

    Snakemake removes what a job declares when the job fails or is to run again. Packings are jamshape's own: finished ones stay
    whatever happens, and those that were cut off go on from the files beside them.
    """
    return Path(OUT) / "reports" / f"{name}.json"


# A report without its packings tells nothing.
for name, (particle, seeds, _) in JOBS.items():
    files = [sweep.file_of(particle, seed, OPTIONS) for seed in seeds]
    if not all(file.exists() for file in files):
        report_of(name).unlink(missing_ok=True)


rule all:
    input:
        [str(report_of(name)) for name in JOBS],


rule packings:
    output:
        str(report_of("{name}")),
    threads: CORES
    resources:
        runtime=count("minutes", 60),
        mem_mb=count("mem_mb", 1000),
    params:
        asked=lambda wildcards: JOBS[wildcards.name][2],
        out=shlex.quote(OUT),
    shell:
        # The report is there only when its packings are: other jobs, which read this file as well, remove it else.
        # A packing that did not reach its goal is there, and would not be another one if the job ran again.
        "said=$({sys.executable} -m jamshape sweep {params.asked} --jobs {threads} --out {params.out})"
        """ || [[ "$said" == *'"not_made": 0,'* ]];"""
        ' echo "$said" > {output:q}'
