"""Features beside the pair styles and the computes."""

from feature import BOX, CROWD, HEAD, LAW, LOAD, RODS, Feature

_STYLE = "pair_style spherocylinder/harmonic sides two\npair_coeff * * 1.0"
_IS = "pair_style spherocylinder/harmonic found"

# A tip 0.8 away from the spine of the other rod: V = (1 - 0.8)^2 / 2, by Hertz's law (1 - 0.8)^(5/2) / (5/2).
_TIP = "set type 2 quat 0 0 1 90\nset type 2 y 12.8"
_ENERGY = 0.02
_HERTZ = 0.2**2.5 / 2.5


def _rods(atom_style: str = "ellipsoid", law: str = LAW, before: str = "", box: str = BOX) -> str:
    """Write the deck of a rod that touches another with its tip."""
    head = HEAD.replace("atom_style ellipsoid", f"atom_style {atom_style}")
    return f"{before}\n{head}\n{box}\n{RODS}\n{_TIP}\n{law}"


_TWO = _rods()
_FREE = _rods(law="thermo_modify norm no")

# The two rods are of type 1; a particle of type 2, without a shape, is 1.5 below the middle of the first.
_BARE = f"""{HEAD}
{BOX}
create_atoms 1 single 10 10 0
create_atoms 1 single 11.5 12.8 0
create_atoms 2 single 10 8.5 0
set type 1 shape 5 1 1
set group all density 1
set atom 2 quat 0 0 1 90
thermo_modify norm no"""
_HYBRID = """pair_style hybrid spherocylinder/harmonic sides two lj/cut 2.5
pair_coeff * * spherocylinder/harmonic 1.0
pair_coeff * 2 lj/cut 1 1"""
_LJ = 4 * (1.5**-12 - 1.5**-6)

# Two superellipses with p = 2 that overlap along x: they would just touch when scaled by eta = 0.9.
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
_SUPER_ENERGY = (1 - 0.9**2) ** 2 / 2
_READ_AGAIN = f"""clear
dimension 2
atom_style ellipsoid
{LOAD}
pair_style superellipsoid/harmonic
read_data x.data
thermo_modify norm no
neighbor 0.3 bin
run 0"""

_BOND_BOX = BOX.replace(
    "create_box 2 box",
    "create_box 2 box bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 2",
)
_BONDED = _rods("hybrid ellipsoid bond", box=_BOND_BOX)
_BOND = "bond_style zero\nbond_coeff 1\ncreate_bonds single/bond 1 1 2\nrun 0"

_ANGLE = """compute angles all property/atom quatw quatk
variable angle atom 2*atan(c_angles[2]/c_angles[1])*180/PI
compute angle wall reduce sum v_angle
thermo_style custom step pe c_angle
thermo_modify norm no
min_style cg
min_modify line backtrack"""
_HELD = f"{HEAD}\n{BOX}\n{RODS}\nset atom 2 quat 0 0 1 20\n{LAW}\ngroup wall type 2\n{_ANGLE}"
_MINIMISE = "minimize 0 1e-12 1000 10000"

_PRESSURES = "compute p all packing\nthermo_style custom step pe press c_p[3]\nrun 0"
_NO_SHAPE = f"{_IS} atom 3 without a shape, expected an ellipsoid: .*"

_ATOMS = (
    Feature("`atom_style hybrid ellipsoid molecular`", "run 0", "pe", _ENERGY, scene=_rods("hybrid ellipsoid molecular")),
    Feature("`atom_style hybrid sphere ellipsoid`", "run 0", "pe", _ENERGY, scene=_rods("hybrid sphere ellipsoid")),
    Feature("`atom_style sphere`", "run 0", refused=f"{_IS} atom_style sphere, expected ellipsoid: .*",
            scene=f"{HEAD.replace('ellipsoid', 'sphere')}\n{BOX}\ncreate_atoms 1 single 1 1 0\n{LAW}"),
    Feature("`atom_modify id no`", "run 0", "pe", _ENERGY, scene=_TWO.replace("map array", "id no")),
    Feature("`atom_modify id no`, `compute packing`", _PRESSURES, scene=_TWO.replace("map array", "id no"),
            refused="compute packing found atoms without IDs, expected one for each: .*"),
    Feature("`units real`", _PRESSURES, "press/c_p[3]", 1.0, scene=_rods(before="units real")),
    Feature("`units metal`", _PRESSURES, "press/c_p[3]", 1.0, scene=_rods(before="units metal")),
    Feature("`units si`", _PRESSURES, "press/c_p[3]", 1.0, scene=_rods(before="units si")),
    Feature("`displace_atoms rotate`", "displace_atoms all rotate 10 10 0 0 0 1 37\nrun 0", "pe", _ENERGY, scene=_TWO),
    Feature("`replicate`", "replicate 2 2 1\nrun 0", "pe", 4 * _ENERGY, scene=_TWO),
    Feature("`create_atoms` after a run", "run 0\ncreate_atoms 1 single 3 3 0\nrun 0", refused=_NO_SHAPE, scene=_TWO),
    Feature("`delete_atoms`", "run 0\ngroup one id 2\ndelete_atoms group one\nrun 0", "pe", 0.0, scene=_TWO),
    Feature("`fix deposit`", "region s block 2 5 2 5 -0.5 0.5\nfix d all deposit 1 2 1 7 region s\nrun 3", refused=_NO_SHAPE, scene=_TWO),
    Feature("`fix evaporate`", "region s block 9 10.5 9 11 -0.5 0.5\nfix d all evaporate 1 1 s 4\nrun 2", "pe", 0.0, scene=_TWO),
    Feature("`set shape` before `run pre no`", "set group all shape 5 0.5 0.5\nrun 0\nset group all shape 5 1 1\nrun 1 pre no",
            "pe", _ENERGY, scene=_TWO),
    Feature("discs that become rods before `run pre no`", "set group all shape 5 5 5\nrun 0\nset group all shape 5 1 1\nrun 1 pre no",
            refused=f"{_IS} atom 1 with a shape that can rotate, although none could at the start of the run: .*", scene=_TWO),
    Feature("`set shape 0` before `run pre no`", "run 0\nset atom 2 shape 0 0 0\nrun 1 pre no", scene=_TWO,
            refused=f"{_IS} atom 2 without a shape, expected an ellipsoid: .*"),
    Feature("`fix atom/swap` of exponents", "pair_coeff 2 2 1 1\nfix s all atom/swap 1 5 3 1.0 ke no types 1 2\nrun 3", scene=_SUPER,
            refused="pair_style superellipsoid/harmonic found fix atom/swap, .*"),
    Feature("`fix rigid` in the plane", "thermo_style custom step pe\nneigh_modify exclude group all all\nfix r all rigid single torque * off off on force * on on off\n"
            "velocity all set 0.3 0.2 0\nset atom 1 quat 0 0 1 35\ntimestep 0.01\nrun 200", "xcm(all,x)", 10.75 + 0.3 * 2, scene=_TWO),
)  # fmt: skip

_PAIRS = (
    Feature("`pair_style hybrid`, other atoms without a shape", f"{_HYBRID}\nrun 0", "pe", _ENERGY + _LJ, scene=_BARE),
    Feature("`pair_style hybrid`, `minimize`", f"{_HYBRID.replace('lj/cut 1 1', 'lj/cut 0 1')}\nmin_modify line backtrack\nminimize 0 1e-9 1000 10000",
            "round(pe*1e6)", 0.0, scene=_BARE),
    Feature("`pair_style hybrid/overlay`", f"{_HYBRID.replace('hybrid', 'hybrid/overlay').replace('* 2 lj/cut 1 1', '* * lj/cut 0 1')}\nrun 0",
            "pe", _ENERGY, scene=_FREE),
    Feature("`pair_style hybrid/scaled`", "pair_style hybrid/scaled 2.0 spherocylinder/harmonic sides two 1.0 lj/cut 2.0\n"
            "pair_coeff * * spherocylinder/harmonic 1.0\npair_coeff * * lj/cut 0 1\nrun 0", "pe", 2 * _ENERGY, scene=_FREE),
    Feature("`pair_style hybrid` of two of ours, `minimize`", "pair_style hybrid spherocylinder/harmonic sides two dimer/harmonic\n"
            f"pair_coeff 1 * spherocylinder/harmonic 1\npair_coeff 2 2 dimer/harmonic 1\n{_MINIMISE}",
            refused="minimize found several of jamshape's pair styles in a hybrid one, .*", scene=_FREE),
    Feature("`pair_style hybrid`, `compute packing`", f"{_HYBRID}\ncompute p all packing\nrun 0", scene=_BARE,
            refused="compute packing found pair_style hybrid, expected one of jamshape's: .*"),
    Feature("`neigh_modify exclude`", "neigh_modify exclude type 1 2\nrun 0", "pe", 0.0, scene=_TWO),
    Feature("`special_bonds lj 0`", f"special_bonds lj 0 1 1 coul 1 1 1\n{_BOND}", "pe", 0.0, scene=_BONDED),
    Feature("`special_bonds lj 1`", f"special_bonds lj 1 1 1\n{_BOND}", "pe", _ENERGY, scene=_BONDED),
    Feature("`special_bonds lj 0.5`", f"special_bonds lj 0.5 1 1\n{_BOND}", scene=_BONDED,
            refused=f"{_IS} special_bonds with a factor of 0.5 for bonded atoms [12] and [12], expected 0 or 1: .*"),
    Feature("`pair_modify shift yes mix arithmetic table 12`", "pair_modify shift yes mix arithmetic table 12\nrun 0", "pe", _ENERGY, scene=_TWO),
    Feature("`pair_modify mix sixthpower`", "pair_modify mix sixthpower\nrun 0", refused=f"{_IS} 'pair_modify mix sixthpower', .*", scene=_TWO),
    Feature("`pair_modify compute no`, `compute packing`", f"pair_modify compute no\n{_PRESSURES}", scene=_TWO,
            refused="compute packing found no contacts of the present atoms, .*"),
    Feature("`pair_coeff 2* 1`", "pair_coeff 2* 1 3.0", refused=r"pair_coeff of spherocylinder/harmonic found types '2\* 1', expected I <= J: .*", scene=_TWO),
    Feature("`pair_write`", "pair_write 1 2 10 r 0.5 1 f.txt X", refused="Pair style does not support pair_write", scene=_TWO),
    Feature("`newton off`", f"clear\nnewton off\n{CROWD}\nrun 0", "pe", "run 0", 1e-14, scene=CROWD),
    Feature("`comm_style tiled`", "comm_style tiled\nbalance 1.1 rcb\nrun 0", "pe", "run 0", 1e-14, scene=CROWD),
    Feature("`neighbor 0 bin`", "neighbor 0 bin\nrun 0", "pe", "run 0", 1e-14, scene=CROWD),
    Feature("`suffix opt`", f"suffix opt\n{_STYLE}\nrun 0", "pe", _ENERGY, scene=_FREE),
)  # fmt: skip

_FILES = (
    Feature("`write_data`, `read_data`", f"run 0\nwrite_data x.data\n{_READ_AGAIN}", "pe", _SUPER_ENERGY, scene=_SUPER),
    Feature("`write_data pair ij`, `read_data`", f"pair_coeff 1 2 0.3\nrun 0\nwrite_data x.data pair ij\n{_READ_AGAIN}", "pe",
            0.3 * _SUPER_ENERGY, scene=_SUPER),
    Feature("`write_coeff`", "run 0\nwrite_coeff x.txt\npair_style superellipsoid/harmonic\ninclude x.txt\nrun 0", "pe", _SUPER_ENERGY, scene=_SUPER),
    Feature("restart file to data file, in a deck", f"run 0\nwrite_restart x.restart\nclear\n{LOAD}\nread_restart x.restart\nwrite_data x.data\n{_READ_AGAIN}",
            "pe", _SUPER_ENERGY, scene=_SUPER),
    Feature("`rerun` of rods", "dump d all custom 1 d.dump id type x y\nrun 0\nrerun d.dump dump x y", scene=_TWO,
            refused="rerun reads no orientations from a dump, expected particles that cannot rotate: .*"),
    Feature("`rerun` of discs", "set group all shape 1 1 1\nset atom 2 x 10 y 10.6\ndump d all custom 1 d.dump id type x y\nrun 1\nrerun d.dump dump x y",
            "pe", 0.5 * 0.4**2, scene=_TWO),
)  # fmt: skip

_FIXES = (
    Feature("`fix setforce 0 0 0`, `minimize`", f"fix hold wall setforce 0 0 0\n{_MINIMISE}", "c_angle", 20.0, scene=_HELD),
    Feature("`fix setforce 0 0 NULL region`, `minimize`", f"region all block 0 20 0 20 -1 1\nfix hold wall setforce 0 0 NULL region all\n{_MINIMISE}",
            "c_angle", 20.0, scene=_HELD),
    Feature("`fix freeze`, `minimize`", f"fix hold wall freeze\n{_MINIMISE}", scene=_HELD,
            refused="minimize found fix hold of style freeze, which LAMMPS ignores in minimisations: .*"),
    Feature("`fix rigid`, `minimize`", f"fix hold all rigid single\n{_MINIMISE}", scene=_HELD,
            refused="minimize found fix hold of style rigid, which LAMMPS ignores in minimisations: .*"),
    Feature("`fix freeze`, p_xy of `compute packing`", "compute p all packing\nfix hold wall freeze\nthermo_style custom step c_p[16]\nrun 0", "c_p[16]",
            "compute p all packing\nthermo_style custom step c_p[16]\nrun 0", scene=_HELD),
    Feature("`min_style fire`", f"min_style fire\n{_MINIMISE}", refused="min_style fire cannot rotate particles: .*", scene=_TWO),
    Feature("`fix adapt` of k_e", "variable k equal 2.0\nfix a all adapt 1 pair spherocylinder/harmonic k_e * * v_k\nrun 0", "pe", 2 * _ENERGY, scene=_TWO),
    Feature("`fix adapt` of mixed k_e", "pair_coeff 1 1 1.0\npair_coeff 2 2 1.0\nvariable k equal 9.0\nfix a all adapt 1 pair spherocylinder/harmonic k_e 1 1 v_k\n"
            "run 0", "pe", 3 * _ENERGY, scene=_rods(law="pair_style spherocylinder/harmonic sides two\nthermo_modify norm no")),
    Feature("`fix adapt` to a negative k_e", "variable k equal -2.0\nfix a all adapt 1 pair spherocylinder/harmonic k_e * * v_k\nrun 0", scene=_TWO,
            refused=f"{_IS} k_e = -2, expected a positive energy: .*"),
    Feature("`fix adapt atom diameter`", "variable k equal 2.0\nfix a all adapt 1 atom diameter v_k\nrun 0",
            refused="Fix adapt requires atom attribute diameter", scene=_TWO),
)  # fmt: skip

_COMPUTES = (
    Feature("`compute pe/atom`", "compute a all pe/atom\ncompute s all reduce sum c_a\nthermo_style custom step c_s\nrun 0", "c_s", _ENERGY, scene=_TWO),
    Feature("`compute stress/atom`", "compute a all stress/atom NULL\ncompute s all reduce sum c_a[2]\nthermo_style custom step pyy c_s\nrun 0",
            "c_s/(pyy*lx*ly)", -1.0, scene=_TWO),
    Feature("`compute centroid/stress/atom`", "compute a all centroid/stress/atom NULL\ncompute s all reduce sum c_a[1]\nthermo_style custom step c_s\nrun 0",
            refused="Pair style does not support compute centroid/stress/atom", scene=_TWO),
    Feature("`compute pair/local`", "compute c all pair/local eng\nrun 0", refused="Pair style does not support compute pair/local", scene=_TWO),
    Feature("`compute group/group`", "group a type 1\ngroup b type 2\ncompute c a group/group b\nrun 0",
            refused="Pair style does not support compute group/group", scene=_TWO),
    Feature("`compute contact/local`, `compute reduce`", "compute c all contact/local energy\ncompute s all reduce sum c_c\nthermo_style custom step c_s\nrun 0",
            "c_s", _ENERGY, scene=_TWO),
)  # fmt: skip

_ONLY = "expected 'law harmonic', 'law hertz' or 'law power A' with A >= 2: .*"


def _read_restart(style: str) -> str:
    """Write the commands that read a restart file, whose pair style goes on without being given again."""
    return f"run 0\nwrite_restart x.restart\nclear\n{LOAD}\nread_restart x.restart\n{style}thermo_modify norm no\nneighbor 0.3 bin\nrun 0"


_LAWS = (
    Feature("`law harmonic`", f"{_STYLE.replace('two', 'two law harmonic', 1)}\nrun 0", "pe", _ENERGY, scene=_TWO),
    Feature("`law hertz`", f"{_STYLE.replace('two', 'two law hertz', 1)}\nrun 0", "pe", _HERTZ, scene=_TWO),
    Feature("`law power 3`", f"{_STYLE.replace('two', 'one law power 3', 1)}\nrun 0", "pe", 0.2**3 / 3, scene=_TWO),
    Feature("`law power 2`", f"{_STYLE.replace('two', 'two law power 2', 1)}\nrun 0", "pe", _ENERGY, scene=_TWO),
    Feature("`law hertz` of superellipsoids", "pair_style superellipsoid/harmonic law hertz\npair_coeff * * 1.0 2.0\nrun 0", "pe", (1 - 0.9**2) ** 2.5 / 2.5,
            scene=_SUPER),
    Feature("`law hertz disable_shortcuts contact`", f"{_STYLE.replace('two', 'two law hertz disable_shortcuts contact', 1)}\nrun 0", "pe", _HERTZ, scene=_TWO),
    Feature("`law hertz`, restart file", f"{_STYLE.replace('two', 'two law hertz', 1)}\n{_read_restart('')}", "pe", _HERTZ, scene=_TWO),
    Feature("`law power 3` of superellipsoids, restart file", f"pair_style superellipsoid/harmonic law power 3\npair_coeff * * 1.0 2.0\n{_read_restart('')}", "pe",
            (1 - 0.9**2) ** 3 / 3, scene=_SUPER),
    Feature("`pair_style hybrid` with `law hertz`, restart file", f"{_HYBRID.replace('two', 'two law hertz', 1)}\nrun 0\nwrite_restart x.restart\nclear\n{LOAD}\n"
            "read_restart x.restart\npair_coeff * * spherocylinder/harmonic 1.0\npair_coeff * 2 lj/cut 1 1\nthermo_modify norm no\nrun 0", "pe", _HERTZ + _LJ,
            scene=_BARE),
    Feature("`law hertz`, virial", f"{_STYLE.replace('two', 'two law hertz', 1)}\nthermo_style custom step pyy lx ly\nrun 0", "pyy*lx*ly", 0.2**1.5 * 2.8, scene=_TWO),
    Feature("`law power 1.5`", _STYLE.replace("two", "two law power 1.5", 1), refused=f"{_IS} 'law power 1.5', {_ONLY}", scene=_TWO),
    Feature("`law hertzian`", _STYLE.replace("two", "two law hertzian", 1), refused=f"{_IS} 'law hertzian', {_ONLY}", scene=_TWO),
    Feature("`law`", "pair_style dimer/harmonic law", refused=f"pair_style dimer/harmonic found 'law', {_ONLY}", scene=_TWO),
    Feature("`law power`", "pair_style dimer/harmonic law power", refused=f"pair_style dimer/harmonic found 'law power', {_ONLY}", scene=_TWO),
)  # fmt: skip

CONTACTS = (*_ATOMS, *_PAIRS, *_LAWS, *_FILES, *_FIXES, *_COMPUTES)
