# Ellipses of aspect ratios from 1 to 10 in the plane, as by S. Rocks and R. S. Hoy, Soft Matter (2023).
include: "../workflow.smk"


rule all:
    input:
        everything,


ELLIPSES = " ".join(f"--superellipsoid 1 {w1:g} 1" for w1 in AT["w1"])
FILES = add_sweep(
    "ellipses",
    f"{ELLIPSES} --dimension 2 --size-ratio 1.4 --samples {AT['samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)
figure("aspect_ratio", "rocks_hoy_2023/aspect_ratio.py", ["packings/ellipses"], ["ellipses"])
LONGEST = [paths[0] for paths in FILES.values() if "seed1." in paths[0]][-1:]
figure("packing", "draw.py", (), ["ellipses"], draws=f"jamshape draw {words(LONGEST)} --out figures/packing.png")
