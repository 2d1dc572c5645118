"""Features beside the pair styles and the computes."""

from features.feature import BOX, CROWD, HEAD, LAW, RODS, Feature

# A tip 0.8 away from the spine of the other rod: V = (1 - 0.8)^2 / 2.
_TIP = "set atom 2 quat 0 0 1 90\nset atom 2 y 12.8"
_ENERGY = 0.02
_TIP_ON_SIDE = f"{HEAD}\n{BOX}\n{RODS}\n{_TIP}\n{LAW}"


def _rods(atom_style: str = "ellipsoid", before: str = "", after: str = "") -> str:
    """Write the deck of a rod that touches another with its tip."""
    head = HEAD.replace("atom_style ellipsoid", f"atom_style {atom_style}")
    return f"{before}\n{head}\n{BOX}\n{RODS}\n{_TIP}\n{LAW}\n{after}"


# A third particle, of type 2 and without a shape, 1.5 below the middle of the first rod.
_BARE = f"""{HEAD}
{BOX}
create_atoms 1 single 10 10 0
create_atoms 1 single 11.5 12.8 0
create_atoms 2 single 10 8.5 0
set type 1 shape 5 1 1
set group all density 1
set atom 2 quat 0 0 1 90
thermo_modify norm no"""
_LJ = 4 * (1.5**-12 - 1.5**-6)

# Two superellipsoids of exponent 2 that overlap along x, both faces flat there: eta = 0.9.
_SUPER = f"""{HEAD}
{BOX}
create_atoms 1 single 10 10 0
create_atoms 2 single 11.8 10 0
set group all shape 2 2 2
set group all density 1
pair_style superellipsoid/harmonic
pair_coeff * * 1.0 2.0
thermo_modify norm no
neighbor 0.3 bin"""
_SUPER_ENERGY = 0.5 * (1 - 0.9**2) ** 2

_AGAIN = f"clear\n{HEAD}"
_BONDED = """bond_style zero
bond_coeff 1
create_bonds single/bond 1 1 2
special_bonds lj {} 1 1"""


def _bonded(factor: float, **wanted: object) -> Feature:
    """Write the feature of a bond between the two rods."""
    box = BOX.replace("create_box 2 box", "create_box 2 box bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 2")
    scene = f"{HEAD.replace('ellipsoid', 'hybrid ellipsoid bond')}\n{box}\n{RODS}\n{_TIP}\n{LAW}"
    commands = f"{_BONDED.format(factor)}\nrun 0"
    return Feature(f"`special_bonds lj {factor:g}`", commands, "pe", scene=scene, **wanted)  # type: ignore[arg-type]


_ATOM_STYLES = (
    Feature("`atom_style hybrid ellipsoid molecular`", "run 0", "pe", _ENERGY, scene=_rods("hybrid ellipsoid molecular")),
    Feature("`atom_style hybrid sphere ellipsoid`", "run 0", "pe", _ENERGY, scene=_rods("hybrid sphere ellipsoid")),
    Feature("`atom_style sphere`", "run 0", scene=f"{HEAD.replace('ellipsoid', 'sphere')}\n{BOX}\ncreate_atoms 1 single 1 1 0\n{LAW}",
        refused="pair_style spherocylinder/harmonic found atom_style sphere, expected ellipsoid: .*"),
    Feature("`atom_modify id no`, forces", "run 0", "pe", _ENERGY, scene=_TIP_ON_SIDE.replace("atom_modify map array", "atom_modify id no").replace("set atom 2", "set type 2")),
)  # fmt: skip
