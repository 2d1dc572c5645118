# The sweep on a cluster, with Snakemake (https://snakemake.readthedocs.io), which knows the batch systems:
#
#   snakemake -s pyscripts/sweep.smk --config out=sweep alpha="0 0.01 1 4" samples=6 n=256 \
#       --executor slurm --jobs 200 --keep-going
#
# Without an executor it runs here. Every packing is one job of one core; what is there is not made again.
import sys

from jamshape.shapes.shape import in_name

OUT = config.get("out", "sweep")
ALPHA = str(config.get("alpha", "0 0.01 1 4")).split()
SEEDS = range(1, int(config.get("samples", 6)) + 1)
OPTIONS = " ".join(
    f"--{name.replace('_', '-')} {config[name]}"
    for name in ("n", "u0", "way", "kappa", "p_end", "tolerance", "size_ratio")
    if name in config
)


rule all:
    input:
        [f"{OUT}/alpha{in_name(float(alpha))}_seed{seed}.h5" for alpha in ALPHA for seed in SEEDS],


rule packing:
    output:
        f"{OUT}/alpha{{alpha}}_seed{{seed}}.h5",
    threads: 1
    shell:
        # A minimum that was not quite reached is a file all the same, and says so.
        "OMP_NUM_THREADS=1 {sys.executable} -m jamshape pack --alpha {wildcards.alpha} "
        "--seed {wildcards.seed} {OPTIONS} --out {output} || test -s {output}"
