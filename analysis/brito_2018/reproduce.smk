# Nearly round particles in two and three dimensions, as by C. Brito, H. Ikeda, P. Urbani, M. Wyart and F. Zamponi, PNAS 115, 11736
# (2018): contacts against asphericity, small forces and gaps, the shear modulus, and the bands of the density of states.
include: "../workflow.smk"


rule all:
    input:
        everything,


ELLIPSES = " ".join(f"--superellipsoid 1 {w1:g} 1" for w1 in AT["w1"])
RODS = " ".join(f"--spherocylinder {alpha:g}" for alpha in AT["alphas"])
PLANE = add_sweep(
    "plane",
    f"--spherocylinder 0 {RODS} {ELLIPSES} --dimension 2 --size-ratio 1.4 --samples {AT['samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)
SPACE = add_sweep(
    "space",
    f"--superellipsoid 1 1 1 {ELLIPSES} --size-ratio 1.4 --samples {AT['space_samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)


def smooth(files):
    """Select the packings of round particles and of ellipses: rods have flat sides, on which bonds come in pairs."""
    return {name: paths for name, paths in files.items() if "p1_" in paths[0] or "alpha0_" in paths[0]}


OF_FORCES = [path for paths in smooth(PLANE).values() for path in paths]
add_modes("modes", "plane", smooth(PLANE))
for name, paths in smooth(PLANE).items():
    asked = f'{words(paths)} --u0 {words(AT["ladder_u0"])} --out ladder/plane'
    add("ladder", f"ladder_{name}", f'python "$analysis/energy_ladder.py" {asked} || true', after=["plane"])
figure("contacts", "brito_2018/contacts.py", ["packings/plane packings/space"], ["plane", "space"])
figure("forces", "brito_2018/forces.py", OF_FORCES, ["plane"])
figure("forces_in_space", "brito_2018/forces.py", ["packings/space"], ["space"])
figure("gaps", "brito_2018/gaps.py", OF_FORCES, ["plane"])
figure("gaps_in_space", "brito_2018/gaps.py", ["packings/space"], ["space"])
figure("shear_modulus", "brito_2018/shear_modulus.py", ["ladder/plane"], ["ladder"])
figure("density_of_states", "marschall_2018/fig11a_density_of_states.py", ["modes/modes"], ["modes"])
