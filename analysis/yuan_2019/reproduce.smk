# All data and every figure of Y. Yuan, K. VanderWerf, M. D. Shattuck and C. S. O'Hern, Soft Matter (2019); Fig. 1 is a
# sketch.
include: "../workflow.smk"


rule all:
    input:
        everything,


FOLDER = "yuan_2019"


def asked(shape):
    """Write a shape as options of a sweep."""
    return f"--superellipsoid {words(shape)}"


def file_of(group, shape, seed=1):
    """Name a packing."""
    parsed = sweep.options_of().parse_args([*asked(shape).split(), "--out", f"packings/{group}"])
    return str(sweep.file_of(sweep.particles(parsed)[0], seed, parsed))


# Protocol 1, Figs. 3 to 7, 9 and 12 to 14.
add_sweep(
    "disordered",
    f"{' '.join(map(asked, AT['shapes']))} --samples {AT['samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)
FIRST = ["packings/disordered"]

# Protocol 2, Figs. 8, 10 and 11: each shape at one or more packing fractions of its Monte Carlo, and so of several orders.
ORDERED = []
for k, (shape, phi, n_sweeps) in enumerate(AT["ordered"], 1):
    group = f"ordered{k}"
    ORDERED.append((f"packings/{group}", shape))
    found = add_sweep(
        group,
        f"{asked(shape)} --samples {AT['ordered_samples']} --n {AT['n']} --protocol yuan-2019-2"
        f" --phi-thermal {phi} --n-sweeps {n_sweeps} {AT['ordered_way']}",
        AT["chunk"],
    )
    GROUPS.setdefault("ordered", []).extend(found)
SECOND = [path for path, _ in ORDERED]

# The same packings at other energies, Fig. 10: superballs of both protocols, as in the paper.
BALL = next(shape for _, shape in ORDERED if shape[1:] == [1, 1] and shape[0] == 1.5)
BALLS = [file_of("disordered", BALL)]
BALLS += [
    file_of(Path(path).name, shape) for path, shape in ORDERED if shape == BALL
][-1:]
for k, ball in enumerate(BALLS, 1):
    add(
        "ladder",
        f"ladder{k}",
        f'python "$analysis/energy_ladder.py" {ball} --u0 {words(AT["ladder_u0"])} --out ladder/{k} || true',
        after=["disordered", "ordered"],
    )


def draw(name, script, *inputs, after=("disordered",)):
    """Add a figure that a script of this folder draws."""
    figure(name, f"{FOLDER}/{script}.py", inputs, after)


BOTH = ("disordered", "ordered")
SPECTRA = [file_of("disordered", shape, seed) for shape in AT["spectra"] for seed in range(1, AT["samples"] + 1)]
draw("fig02", "fig02_shapes", after=())
draw("fig03", "fig03_phi_j", FIRST)
draw("fig04a", "fig04_global_order", FIRST)
draw("fig05", "fig05_asphericity", FIRST)
draw("fig06", "fig05_asphericity", FIRST, "--quantity z")
draw("fig07", "fig07_shape_map", FIRST)
draw("fig08a_11a", "fig08_order_density", FIRST, SECOND, after=BOTH)
draw("fig09a", "fig09a_eigenvalues", SPECTRA, "--modes modes/fig09a")
draw("fig09b", "fig09b_quartic_modes", FIRST, "--modes modes/fig09b")
draw("fig10", "fig10_quartic_energy", BALLS, *(f"ladder/{k + 1}" for k in range(len(BALLS))), after=("ladder",))
draw("fig11b", "fig09a_eigenvalues", SECOND, "--modes modes/fig11b", after=BOTH)
draw("fig11b_inset", "fig09b_quartic_modes", SECOND, "--modes modes/fig11b_inset", after=BOTH)
draw("fig12", "fig12_shape_plane", FIRST)
draw("fig13", "fig13_local_order", FIRST, SECOND, after=BOTH)
draw("fig14", "fig14_curvature", FIRST)
# Packings coloured by local order, Figs. 4 b, c and 8 b.
draw_color = 'jamshape draw {} --color {} --out figures/{}.png'
PICTURES = {
    "fig04b": ([file_of("disordered", [0.75, 0.4, 1])], "S2"),
    "fig04c": ([file_of("disordered", [2, 1, 1])], "C4"),
    "fig08b": (BALLS, "C4"),
}
for name, (files, color) in PICTURES.items():
    figure(name, "draw.py", (), BOTH, draws=draw_color.format(words(files), color, name))
