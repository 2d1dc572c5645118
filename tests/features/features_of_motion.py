"""Features beside the fix that moves particles and box."""

from math import exp, pi

from feature import CROWD, DISC, LOAD, Feature

FIX = "fix f all overdamped/affine drag 1.0 compress 1e-2"
FLOW = f"{FIX}\ntimestep 0.1"
REST = "fix f all overdamped/affine drag 1.0\ntimestep 0.1"
EDGE = 20 * exp(-0.05)  # after 50 steps of FLOW
PLAIN = f"{FLOW}\nrun 50"
AREA = pi / 4
_DISCS = "set group all shape 1.1 1.1 1.1"


def _beside(name: str, command: str, sentence: str) -> Feature:
    """Make the row of a fix that is refused beside ours."""
    return Feature(name, f"{FLOW}\nfix g all {command}\nrun 50", refused=sentence)


def _moves(style: str, arguments: str = "") -> Feature:
    return _beside(
        f"`fix {style}`",
        f"{style} {arguments}",
        rf"fix overdamped/affine found fix {style} \(g\), which also moves particles, .*",
    )


def _on_velocities(style: str, arguments: str) -> Feature:
    return _beside(
        f"`fix {style}`",
        f"{style} {arguments}",
        rf"fix overdamped/affine found fix {style} \(g\), which acts on velocities, .*",
    )


def _changes_box(style: str, arguments: str) -> Feature:
    return _beside(
        f"`fix {style}`",
        f"{style} {arguments}",
        "Must not have multiple fixes change box parameter x",
    )


def _unchanged(name: str, commands: str, before: str = "") -> Feature:
    """Make the row of a feature that must leave the motion as it is."""
    scene = f"{before}\n{CROWD}"
    return Feature(name, f"{FLOW}\n{commands}\nrun 50", "c_poses", PLAIN, 1e-12, scene=scene)


_TIME = (
    Feature("`run_style respa`", f"run_style respa 2 2\n{PLAIN}",
            refused="fix overdamped/affine found run_style respa, expected verlet: .*"),
    *(
        Feature(f"`timestep {dt}`", f"{FIX}\ntimestep {dt}\nrun 50",
                refused=f"fix overdamped/affine found timestep {dt}, expected a positive one: .*")
        for dt in ("0", "-0.1")
    ),
    Feature("`timestep` between runs", f"{FLOW}\nrun 20\ntimestep 0.05\nrun 60", "lx", EDGE),
    Feature("`timestep`, then `run pre no`", f"{FLOW}\nrun 20\ntimestep 0.05\nrun 60 pre no", "lx", EDGE),
    Feature("`fix dt/reset`: box", f"{FLOW}\nfix d all dt/reset 5 0.001 0.15 0.01\nrun 100",
            "lx*exp(0.01*time)", 8, scene=CROWD),
    Feature("`fix dt/reset`: time", f"{FLOW}\nfix d all dt/reset 5 0.001 0.15 0.01\nrun 100",
            "f_f[1]/time", 1, scene=CROWD),
    Feature("`reset_timestep`", f"{FLOW}\nrun 20\nreset_timestep 0",
            refused="Cannot reset timestep with a time-dependent fix defined"),
    Feature("`run 0`, `run upto`, `run start stop`",
            f"{FLOW}\nrun 0\nrun 20 start 0 stop 90\nrun 0\nrun 50 upto", "lx", EDGE),
    Feature("`run every`", f"{FLOW}\nrun 50 every 10 'print here'", "lx", EDGE),
    Feature("several runs", f"{FLOW}\nrun 10\nrun 10 pre no\nrun 30 pre no post no", "c_poses", PLAIN,
            1e-12, scene=CROWD),
    Feature("`unfix`, then `fix` again", f"{FLOW}\nrun 25\nunfix f\n{FIX}\nrun 25", "lx", EDGE),
    Feature("`minimize` between runs: strain", f"{FLOW}\nrun 25\nminimize 0 1e-12 50 50\nrun 25",
            "f_f[2]", 0.05),
    Feature("`minimize` between runs: box", f"{FLOW}\nrun 25\nminimize 0 1e-12 50 50\nrun 25", "lx", EDGE),
    Feature("`fix halt`", f"{FLOW}\nvariable k equal step\nfix h all halt 1 v_k >= 20 error continue\nrun 50",
            "lx", 20 * exp(-0.02)),
    Feature("`prd`", f"{FLOW}\ncompute e all event/displace 0.5\nprd 10 1 1 1 1 e 3",
            refused=r"fix overdamped/affine found fix EVENT/PRD \(prd_event\), which acts on velocities, .*"),
    Feature("`temper`", f"{FLOW}\nvariable t world 1 2\ntemper 10 5 $t f 3 5",
            refused="Tempering temperature fix is not supported", ranks=2),
    Feature("`tad`", f"{FLOW}\natom_modify sort 0 0\ncompute e all event/displace 0.5\nfix n all neb 1\ntad 10 1 1 2 0.5 1 e",
            refused=r"fix overdamped/affine found fix EVENT/TAD \(tad_event\), which acts on velocities, .*", ranks=2),
    Feature("`neb`", f"{FLOW}\nfix n all neb 1\nmin_style quickmin\nneb 0 0.1 10 10 1 none",
            refused="min_style quickmin cannot rotate particles: .*", ranks=2),
)  # fmt: skip

_FIXES = (
    _moves("nve"),
    _moves("nve/asphere"),
    _moves("nve/limit", "0.1"),
    _moves("nve/noforce"),
    _moves("nvt/asphere", "temp 1 1 1"),
    _moves("move", "linear 1 0 0"),
    _moves("rigid", "single"),
    _moves("tfmc", "0.1 1 5"),
    _changes_box("nph/asphere", "iso 0 0 1"),
    _changes_box("npt/asphere", "temp 1 1 1 iso 0 0 1"),
    _changes_box("deform", "1 x erate 0.1"),
    _changes_box("press/berendsen", "iso 0 0 1"),
    _changes_box("box/relax", "iso 0"),
    _changes_box("overdamped/affine", "drag 1.0 compress 1e-2"),
    _on_velocities("langevin", "1 1 1 3"),
    _on_velocities("viscous", "1"),
    _on_velocities("temp/berendsen", "1 1 1"),
    _on_velocities("temp/rescale", "1 1 1 0.1 1"),
    _on_velocities("momentum", "1 linear 1 1 1"),
    _on_velocities("heat", "1 1"),
    _on_velocities("ehex", "1 1"),
    _on_velocities("thermal/conductivity", "1 x 10"),
    _beside("`fix recenter`", "recenter 5 5 NULL",
            "fix overdamped/affine found that something else moved atom 1 in the last steps, .*"),
    _beside("`fix wall/reflect`", "wall/reflect xlo EDGE",
            "Cannot use fix wall/reflect in periodic dimension"),
    Feature("`fix deposit` beside the fix",
            f"{FLOW}\nregion r block 2 4 2 4 -0.1 0.1\nfix g all deposit 1 1 5 3 region r\nrun 50",
            refused="fix overdamped/affine found atom 3 without a shape, expected an ellipsoid: .*"),
    Feature("a group other than all", f"group one id 1\n{FIX.replace('all', 'one')}",
            refused="fix overdamped/affine found a group other than all, .*"),
    Feature("`fix_modify` of another option", f"{FLOW}\nfix_modify f energy yes", refused="Illegal fix_modify command"),
    Feature("`fix addforce`", f"{REST} \nfix g all addforce 0.01 0 0\nrun 50", "x[1]",
            5 + 0.01 * 5 / AREA, scene=DISC),
    Feature("`fix addforce`, substeps",
            f"{REST.replace('1.0', '1.0 integrator rkc2')}\nfix g all addforce 0.01 0 0\nrun 50", "x[1]",
            5 + 0.01 * 5 / AREA, scene=DISC),
    Feature("`fix gravity`", f"{REST}\nfix g all gravity 0.01 vector 1 0 0\nrun 50", "x[1]",
            5 + pi / 6 * 0.01 * 5 / AREA, scene=DISC),
    Feature("`fix spring tether`", f"{REST}\nfix g all spring tether 0.2 3 NULL NULL 0\nrun 50", "x[1]",
            3 + 2 * (1 - 0.02 / AREA + 0.5 * (0.02 / AREA) ** 2) ** 50, scene=DISC),
    Feature("`fix setforce 0 0 0`: moves with the host", f"{FLOW}\nfix g all setforce 0 0 0\nrun 50", "x[2]",
            10 + 1.5 * exp(-0.05)),
    Feature("`fix freeze`: moves with the host", f"{FLOW}\nfix g all freeze\nrun 50", "x[2]",
            10 + 1.5 * exp(-0.05)),
    Feature("`fix freeze`: no rotation", f"{FLOW}\nfix g all freeze\nrun 50", "c_turned", 0.0),
    _unchanged("`fix enforce2d`", "fix g all enforce2d"),
    _unchanged("`fix ave/time`, `fix vector`, `fix print`",
               "fix g all ave/time 1 5 10 c_poses\nfix h all vector 5 c_turned\nfix p all print 10 here"),
    _unchanged("`fix store/state`, `fix store/force`", "fix g all store/state 5 x y\nfix h all store/force"),
    _unchanged("`fix balance`, `comm_style tiled`", "comm_style tiled\nfix g all balance 5 1.0 rcb"),
    Feature("`fix evaporate` beside the fix", f"{FLOW}\nregion r block INF INF INF INF INF INF\n"
            "fix g all evaporate 10 1 r 3\nrun 50", "count(all)", 59, scene=CROWD),
)  # fmt: skip

_STATES = (
    Feature("`velocity`: pressure", f"velocity all create 1.0 3\n{PLAIN}", "press", PLAIN, 1e-12,
            warned="fix overdamped/affine set velocities to 0", scene=CROWD),
    Feature("`velocity`, then `run pre no`: pressure",
            f"{FLOW}\nrun 25\nvelocity all create 1.0 3\nrun 25 pre no", "press", PLAIN, 1e-12,
            warned="fix overdamped/affine set velocities to 0", scene=CROWD),
    Feature("`change_box final`: strain", f"{FLOW}\nrun 20\nchange_box all x final 0 20 remap\nrun 30",
            "f_f[2]", 0.03, warned="fix overdamped/affine found a box other than the one it left"),
    Feature("`change_box triclinic`", f"{FLOW}\nrun 20\nchange_box all triclinic",
            refused="Cannot change box ortho/triclinic with certain fixes defined"),
    Feature("`replicate` beside the fix", f"{FLOW}\nrun 25\nreplicate 2 2 1",
            refused="Cannot replicate with fixes that store atom quantities"),
    Feature("`displace_atoms` between runs", f"{FLOW}\nrun 25\ndisplace_atoms all move 1 0 0\nrun 25", "x[1]",
            10 + (-5 * exp(-0.025) + 1) * exp(-0.025), scene=DISC),
    Feature("`displace_atoms`, then `run pre no`",
            f"{FLOW}\nrun 25\nrun 0\ndisplace_atoms all move 1 0 0\nrun 25 pre no", "x[1]",
            10 + (-5 * exp(-0.025) + 1) * exp(-0.025), scene=DISC),
    Feature("`create_atoms` between runs",
            f"{FLOW}\nrun 25\ncreate_atoms 1 single 3 3 0\nset atom 3 shape 1 1 1\nrun 25", "x[3]",
            10 - 7 * exp(-0.025)),
    Feature("`delete_atoms` between runs", f"{FLOW}\nrun 25\ngroup one id 2\ndelete_atoms group one\nrun 25",
            "f_f[2]", 0.05),
    *(
        Feature(f"`set shape` between runs{more}",
                f"{REST}\nfix g all addforce 0.01 0 0\nrun 20\nset atom 1 shape 0.5 0.5 0.5\nrun 30{more}",
                "x[1]", 5 + 0.01 * (2 / AREA + 3 / (AREA / 4)), scene=DISC)
        for more in ("", " pre no")
    ),
    Feature("`write_restart`, `read_restart remap`: strain",
            f"{FLOW}\nrun 25\nwrite_restart r.rst\nclear\n{LOAD}\natom_style ellipsoid\n"
            f"read_restart r.rst remap\npair_style spherocylinder/harmonic sides two\n{FIX}\nrun 25",
            "f_f[2]", 0.05),
    Feature("`f_f[5]` before a run", FLOW, "f_f[5] != f_f[5]", 1),
    Feature("`rerun` of discs beside the fix", f"{_DISCS}\ndump d all custom 25 d.dump id type x y\ndump_modify d format float "
            "%.17g\nrun 0\ndisplace_atoms all random 0.1 0.1 0 5\nrerun d.dump dump x y", "pe",
            f"{_DISCS}\nrun 0", scene=CROWD),
    _unchanged("`balance`", "balance 1.0 shift x 5 1.05"),
    _unchanged("`atom_modify sort`", "atom_modify sort 1 1.0"),
    _unchanged("`neighbor multi`, `comm_modify mode multi`", "neighbor 0.3 multi\ncomm_modify mode multi"),
    _unchanged("`comm_modify vel yes`, `cutoff`", "comm_modify vel yes cutoff 3"),
    _unchanged("`suffix omp`", "", before="suffix omp"),
    _unchanged("`thermo_modify`, `thermo`", "thermo_modify lost error flush yes\nthermo 5"),
)  # fmt: skip

MOVING = (*_TIME, *_FIXES, *_STATES)
