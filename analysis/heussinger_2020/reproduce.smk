# Spherocylinders in space of aspect ratios from 0 to 20, as by C. Heussinger (2020): density, contacts, and rods with contacts at
# both ends.
include: "../workflow.smk"


rule all:
    input:
        everything,


RODS = " ".join(f"--spherocylinder {alpha:g}" for alpha in AT["alphas"])
FILES = add_sweep(
    "rods",
    f"{RODS} --dimension 3 --size-ratio 1 --samples {AT['samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)
OF_MODES = tuple(f"rods_alpha{alpha:g}_" for alpha in AT["mode_alphas"])
WITH_MODES = {name: paths for name, paths in FILES.items() if name.startswith(OF_MODES)}
add_modes("modes", "rods", WITH_MODES, " --least-force 1e-6")  # as contacts at ends are counted
figure("end_contacts", "heussinger_2020/end_contacts.py", ["packings/rods --modes modes/modes"], ["rods", "modes"])
LONGEST = [paths[0] for paths in FILES.values() if "seed1." in paths[0]][-1:]
figure("packing", "draw.py", (), ["rods"], draws=f"jamshape draw {words(LONGEST)} --out figures/packing.png")
