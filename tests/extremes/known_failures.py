"""Cases that are known to fail: label to reason, and whether they must fail wherever they run."""

_LINE_SEARCH = (
    "LAMMPS's quadratic line search goes back where all contacts open in one step: energy ratio 1, "
    "0 with backtrack, which the deck uses"
)
_FREE_MOTION = (
    "a single contact below jamming may open and close by more than its overlap at a kappa of 1e-14: "
    "free motion is resolved to sqrt(overlap size) only, as docs/explanation/slow-compressions.md says"
)
_NO_MODES = (
    "overlaps of a third of rods: the minimum lies on a kink, where a bond goes from one rod's tip to the "
    "other's and second derivatives jump, so that there are no modes"
)
_FLAT_ON_FLAT = (
    "flat faces of p = 10 that lie on each other: a turn by 1e-14 takes the torque through its balance, and "
    "angles are known to 1e-16 or 1e-19: forces balance, torques to a few tenths of a bond's"
)
_KINK_IN_SPACE = (
    "the packing lies on a kink, where a bond goes from one tip to the other of nearly round rods side by side: "
    "minima on kinks are found in the plane only"
)

KNOWN = {
    "quasistatic compression: 3D, alpha 0.01": (_KINK_IN_SPACE, False),
    **{
        f"quasistatic compression: {D}D, p 10, w {w}": (_FLAT_ON_FLAT, False)
        for D, w in ((2, "0.1"), (2, "1"), (3, "0.1"), (3, "1"), (3, "10"))
    },
    **{
        f"spectrum: {where}overlaps of a third": (_NO_MODES, False)
        for where in ("", "3D, ")
    },
    **{
        f"implicit compression: kappa 1e-14, tr-bdf2, from {start} of the steady overlap": (_FREE_MOTION, False)
        for start in (1, 10)
    },
    **{
        f"LAMMPS minimize, spherocylinders: alpha 1e-6 to 100 in one box, {style}, line quadratic": (_LINE_SEARCH, True)
        for style in ("cg", "sd")
    },
}  # fmt: skip
