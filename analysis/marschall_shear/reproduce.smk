# Steady shear of rods in the plane, as by T. Marschall, Y.-E. Keta, P. Olsson and S. Teitel, Phys. Rev. Lett. 122, 188002 (2019),
# T. A. Marschall and S. Teitel, Phys. Rev. E 100, 032906 (2019), and with D. Van Hoesen, Phys. Rev. E 101, 032901 (2020).
include: "../workflow.smk"


rule all:
    input:
        everything,


FOLDER = "marschall_shear"
RUNS = {}
for alpha, fractions in AT["phis"].items():
    for phi in fractions:
        for gdot, strain in AT["strains"].items():
            for seed in range(1, AT["samples"] + 1):
                name = f"alpha{alpha}_phi{phi:g}_gdot{gdot}_seed{seed}"
                RUNS[alpha, phi, gdot, seed] = f"shears/{name}.h5"
                add(
                    f"shears{alpha}",
                    name,
                    f"jamshape shear --alpha {alpha} --phi {phi:g} --gdot {gdot} --strain {strain} --n {AT['n']} --seed {seed}"
                    f" {AT['way']} --out shears/{name}.h5",
                )
ALL = [f"shears{alpha}" for alpha in AT["phis"]]
LOWEST = min(AT["strains"], key=float)

# The same rods compressed, beside the onset of shear.
add_sweep(
    "rods",
    f"--alpha {' '.join(AT['phis'])} --samples {AT['compressed']} --n {AT['n']} --u0 1e-12",
    AT["chunk"],
)


def runs_of(alpha, gdot=None, phi=None):
    """Name the runs of an aspect ratio, all of them or those of a rate and a packing fraction."""
    return [
        path for (a, p, g, _), path in RUNS.items() if a == alpha and gdot in (None, g) and phi in (None, p)
    ]


EVERY = list(RUNS.values())
figure("onsets", f"{FOLDER}/onsets.py", [EVERY, "--packings packings/rods"], [*ALL, "rods"])
figure("order", f"{FOLDER}/order.py", EVERY, ALL)
figure("rheology", "shear/rheology.py", [runs_of(alpha, LOWEST) for alpha in AT["phis"]], ALL)
for alpha in AT["phis"]:
    figure(f"flow_curves_alpha{alpha}", "shear/flow_curves.py", runs_of(alpha), [f"shears{alpha}"])
LONGEST = max(AT["phis"], key=float)
figure("class_stress", "shear/class_stress.py", runs_of(LONGEST, LOWEST), [f"shears{LONGEST}"])
DENSEST = [runs_of(alpha, LOWEST, max(AT["phis"][alpha]))[0] for alpha in AT["phis"] if float(alpha)]
figure("contact_angles", "shear/contact_angles.py", DENSEST, ALL)
figure("rotation", "shear/rotation.py", DENSEST[-1:], [f"shears{LONGEST}"])
