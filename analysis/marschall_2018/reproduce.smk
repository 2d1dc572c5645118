# All data and every figure of T. Marschall and S. Teitel, Phys. Rev. E 97, 012905 (2018); Figs. 1 and 6 are sketches of
# the model. `beside_paper.py` is left out, since agreement.py puts more numbers beside the paper's.
include: "../workflow.smk"


rule all:
    input:
        everything,


FOLDER = "marschall_2018"
U0 = 1e-15  # of the packings whose modes the paper shows

# Packings, Figs. 5 to 10 and 21.
SWEEP = add_sweep(
    "rods",
    f"--alpha {words(AT['alphas'])} --samples {AT['samples']} --n {AT['n']} {AT['way']}",
    AT["chunk"],
)
RODS = ["packings/rods"]

# Some of them by the protocol of the paper, which compresses at a rate, beyond jamming, and then opens the box.
add_sweep(
    "published",
    f"--alpha {words(AT['published_alphas'])} --samples {AT['published_samples']} --n {AT['n']}"
    f" --protocol marschall-2018 {AT['published_way']}",
    AT["chunk"],
)
BOTH = [*RODS, "packings/published"]


def packings(alpha, samples=1):
    """Name the first packings of an aspect ratio."""
    found = [path for paths in SWEEP.values() for path in paths if f"/alpha{alpha:g}_seed" in path]
    return found[:samples]


# Modes, Figs. 11 to 20, of discs and of the three aspect ratios that the paper treats.
OF_MODES = (0, 0.01, 1, 4)
add_modes(
    "modes",
    "rods",
    {job: paths for job, paths in SWEEP.items() if any(f"/alpha{a:g}_" in paths[0] for a in OF_MODES)},
)

# The same packings at other energies, Figs. 14, 18 and 20; those that are not reached are left out. Their modes are found
# with all bonds and without those that graze.
for alpha in OF_MODES[1:]:
    for packing in packings(alpha, AT["ladder_samples"]):
        ladder, name = f"ladder/alpha{alpha:g}", Path(packing).stem
        add(
            "ladder",
            f"ladder_{name}",
            f'python "$analysis/energy_ladder.py" {packing} --u0 {words(AT["ladder_u0"])} --out {ladder} || true;'
            f" {modes_of(f'{ladder}/{name}_*.h5', 'ladder')}",
            after=[f"rods_alpha{alpha:g}"],
        )
        add(
            "bearing",
            f"bearing_{name}",
            modes_of(f"{ladder}/{name}_*.h5", "bearing", " --least-force 1e-6"),
            after=["ladder"],
        )

# And compressed by equal steps, for lines through a pressure without a rate, and opened again.
for alpha, end in AT["above_phi"].items():
    for packing in packings(float(alpha), AT["above_samples"]):
        add(
            "above",
            f"above_{Path(packing).stem}",
            f'python "$analysis/{FOLDER}/quasistatic_pressure.py" {packing} --phi-end {end} --out packings/above || true',
            after=[f"rods_alpha{alpha}"],
        )

# Compressions at finite rates, Figs. 3 and 4.
SLOW, ONE_BOND = {}, []


def add_slow(name, alpha, kappa, seed, options=""):
    """Add a compression of an aspect ratio at a rate; return its file."""
    start, slow, end = AT["slow_phi"][alpha]
    add(
        "slow",
        name,
        f"jamshape slow --alpha {alpha} --n {AT['slow_n']} --seed {seed} --kappa {kappa}{options}"
        # The exit code is 1 where minimisations of frames came to no end, too, which the report counts.
        f" --phi-start {start} --phi-slow {slow} --phi-end {end} --out runs/{name}.h5 || true",
    )
    return f"runs/{name}.h5"


for alpha in AT["slow_phi"]:
    for kappa in AT["slow_kappas"]:
        for seed in range(1, AT["slow_samples"] + 1):
            name = f"slow_alpha{alpha}_kappa{kappa}_seed{seed}"
            SLOW[alpha, kappa, seed] = add_slow(name, alpha, kappa, seed)
# With one bond side to side, as in the paper's dynamics.
for alpha in AT["one_bond_alphas"]:
    for kappa in AT["one_bond_kappas"]:
        for seed in range(1, AT["one_bond_samples"] + 1):
            name = f"one_bond_alpha{alpha}_kappa{kappa}_seed{seed}"
            ONE_BOND.append(add_slow(name, alpha, kappa, seed, " --sides 1"))
SLOWEST = [path for (alpha, kappa, _), path in SLOW.items() if (alpha, kappa) == ("4", AT["slow_kappas"][-1])]

# Compressions for orientational order, Fig. 2: of two sizes of rods mixed, and of one size.
ORDER = []
for n in AT["order_n"]:
    for ratio in (1.4, 1):
        for seed in range(1, AT["order_samples"] + 1):
            name = f"order_n{n}_ratio{ratio}_seed{seed}"
            ORDER.append(f"runs/{name}.h5")
            add(
                "order",
                name,
                f"jamshape compress --no-minimising --alpha 4 --size-ratio {ratio} --n {n} --seed {seed}"
                f" --kappa {AT['order_kappa']} --phi-start 0.2 --phi-end 0.9 --out runs/{name}.h5",
            )


def draw(name, script, *inputs, after):
    """Add a figure that a script of this folder draws."""
    figure(name, f"{FOLDER}/{script}.py", inputs, after)


draw("fig02", "fig02_order", ORDER, after=["order"])
draw("fig03", "fig03_slow_compression", list(SLOW.values()), after=["slow"])
draw("fig03_one_bond", "fig03_slow_compression", ONE_BOND, after=["slow"])
draw("pressure_lines", "pressure_lines", list(SLOW.values()), "--quasistatic packings/above", after=["slow", "above"])
draw("fig04", "fig04_pressure", SLOWEST, after=["slow"])
draw("fig05", "fig05_phi_j", BOTH, after=["rods", "published"])
draw("fig07", "fig07_snapshots", RODS, "--alpha 0.01 4", after=["rods"])
draw("fig08", "fig08_contact_number", BOTH, after=["rods", "published"])
draw("fig09", "fig09_contact_classes", RODS, after=["rods"])
draw("fig10", "fig10_contact_angles", RODS, "--alpha 0.01 0.12 1", after=["rods"])
draw("fig21", "fig21_residuals", RODS, "--alpha 0.01 4", after=["rods"])

# Figs. 11, 15 and 19 are the same of three aspect ratios, Fig. 11(a) beside discs.
for number, alpha in ((11, 0.01), (15, 4), (19, 1)):
    beside = f"0 {alpha}" if number == 11 else alpha
    draw(f"fig{number}a", "fig11a_density_of_states", "modes/modes --alpha", beside, after=["modes"])
    draw(f"fig{number}b", "fig11b_participation", "modes/modes --alpha", alpha, after=["modes"])
    draw(f"fig{number}c", "fig11c_mode_components", "modes/modes --alpha", alpha, after=["modes"])

# Single packings and their modes.
draw("fig12", "fig12_modes", packings(0.01), after=["rods"])
draw("fig16", "fig12_modes", packings(4), "--zoom", after=["rods"])
draw("fig13", "fig13_energy_along_modes", packings(0.01), after=["rods"])
draw("fig17", "fig13_energy_along_modes", packings(4), after=["rods"])

# At several energies.
# As in the paper; nearly round rods end on corners of the energy where overlaps are as large as their flat sides are long.
for number, alpha, largest in ((14, 0.01, 1e-12), (18, 4, 1)):
    shown = [u0 for u0 in AT["ladder_u0"] if U0 <= float(u0) <= largest]
    asked = ("modes/ladder --alpha", alpha)
    draw(f"fig{number}a", "fig11a_density_of_states", *asked, "--u0", shown, after=["ladder"])
for name, alpha in (("fig14b", 0.01), ("fig18b", 4), ("fig20", 1)):
    for group, suffix in (("ladder", ""), ("bearing", "_bearing")):
        draw(f"{name}{suffix}", "fig14_band_frequency", f"modes/{group} --alpha", alpha, after=[group])
LADDERS = [f"ladder/alpha{alpha:g}" for alpha in OF_MODES[1:]]
draw("fig14_jamming_distance", "fig14_jamming_distance", LADDERS, after=["ladder"])

# The check that closes Sec. III C makes packings of its own, in a folder.
figure(
    "singular_limit",
    f"{FOLDER}/singular_limit.py",
    (),
    ["rods"],
    draws=f'python "$analysis/{FOLDER}/singular_limit.py" packings/rods --out singular_limit'
    " && cp singular_limit/singular_limit.png figures/singular_limit.png",
)
