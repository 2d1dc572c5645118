# Bidisperse packings of many shapes in the plane, as by K. VanderWerf, W. Jin, M. D. Shattuck and C. S. O'Hern, Phys. Rev. E 97, 012909
# (2018): density and contacts against asphericity, and quartic modes beside missing contacts.
include: "../workflow.smk"


rule all:
    input:
        everything,


FOLDER = "vanderwerf_2018"
FILES = add_sweep(
    "disordered",
    f"{' '.join(AT['shapes'])} --dimension 2 --size-ratio 1.4 --samples {AT['samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)
FIRST = ["packings/disordered"]

figure("asphericity", f"{FOLDER}/asphericity.py", FIRST, ["disordered"])
figure("constraints", f"{FOLDER}/constraints.py", [*FIRST, "--modes modes"], ["disordered"])
# One packing of each kind of shape, by its first sample.
SHOWN = [paths[0] for name, paths in FILES.items() if paths[0].endswith("seed1.h5")]
figure("packings", "draw.py", (), ["disordered"], draws=f"jamshape draw {words(SHOWN)} --out figures/packings.png")
