"""fix overdamped/affine in any affine flow: shear, pure shear, and compression on the way."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from lammps_runs import (
    after_restart,
    difference_from_library,
    dump,
    error_of,
    fix_vector,
    global_vector,
    load_plugin,
    loaded,
    restarted,
    run_lmp,
    run_lmp_well,
    scene,
    state_of,
)
from lammps_scenes import angle_between, dense, rods
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from thinned import in_turn

from jamshape.packing import Box, Packing

pytestmark = pytest.mark.lammps

TILT = "change_box all triclinic"


def drive(flow, dt, options="", k_d=1.0):
    return f"""
        fix drive all overdamped/affine drag {k_d} {flow} {options}
        timestep {dt}"""


def unwrapped(session, like=None):
    """Positions of the particles that the box's images bring back, (N, D)."""
    packing = state_of(session, like).packing
    return packing.position + packing.image @ packing.box.matrix.T


# --- no contact: closed forms --------------------------------------------------------------------


def mean_squares(alpha):
    """Mean of x^2 and of y^2 over a spherocylinder of R = 1 in the plane, x along it."""
    height = lambda x: np.sqrt(max(1 - max(abs(x) - alpha, 0.0) ** 2, 0.0))
    parts = [(0, alpha), (alpha, alpha + 1)]
    over = lambda f: sum(quad(f, *part, epsabs=1e-14)[0] for part in parts)
    area = over(height)
    return over(lambda x: x * x * height(x)) / area, over(lambda x: height(x) ** 3 / 3) / area


def lonely_rods(alpha):
    """Far apart, at several angles and images of the box."""
    angle = np.linspace(-3.0, 3.0, 9)
    position = 12.0 * np.stack(np.unravel_index(np.arange(9), (3, 3)), axis=1) - 17.0
    image = np.random.default_rng(1).integers(-2, 3, (9, 2))
    return rods(position, angle, 0.3 * alpha, 0.3, [36.0, 36.0], image=image)


def angle_under_shear(start, turn, c):
    """Solution of d theta / dt = -(g / 2) (1 - c cos 2 theta), `turn` = g t."""
    part = np.sqrt((1 - c) / (1 + c))
    phase = np.arctan2(np.sin(start), part * np.cos(start))
    phase = phase - 0.5 * np.sqrt(1 - c * c) * turn
    return np.arctan2(part * np.sin(phase), np.cos(phase))


@pytest.mark.parametrize("alpha", [0.0, 1e-6, 0.01, 4.0])
def test_isolated_rods_turn_as_the_closed_form_of_simple_shear(alpha, tmp_path, measured):
    packing, rate, dt, steps = lonely_rods(alpha), 0.02, 0.01, 16_000
    along, across = mean_squares(alpha)
    c = (along - across) / (along + across)
    with loaded(packing, tmp_path, extra="box tilt large") as session:
        session.commands("pair_style spherocylinder/harmonic sides one disable_shortcuts rotation")
        session.commands(f"pair_coeff * * 1.0\n{TILT}\n{drive(f'shear {rate}', dt)}\nrun 0")
        start = unwrapped(session)
        session.commands(f"run {steps}")
        end, angle = unwrapped(session), state_of(session).packing.orientation
        strain, mean_turn = (fix_vector(session, "drive", k) for k in (17, 19))
    turn = rate * dt * steps
    expected = angle_under_shear(packing.orientation, turn, c)
    error = np.abs((angle - expected + np.pi / 2) % np.pi - np.pi / 2).max()
    moved = np.abs(end - (start + np.outer(start[:, 1], [turn, 0]))).max() / 36.0
    measured(angle=error, position=moved, strain=abs(strain / turn - 1))
    assert error < 1e-8
    assert moved < 1e-13
    assert strain == pytest.approx(turn, rel=1e-14)
    if alpha == 0.0:
        assert mean_turn == pytest.approx(-0.5 * turn, rel=1e-10)


def test_mean_rotation_and_order_of_an_orbit_are_those_of_the_closed_form(tmp_path, measured):
    """A turn by pi takes 2 pi / (g (1 - c^2)^(1/2)); on the mean S_2 is (1 - (1 - c^2)^(1/2)) / c."""
    alpha, rate, samples = 4.0, 0.02, 200
    along, across = mean_squares(alpha)
    c = (along - across) / (along + across)
    root = np.sqrt(1 - c * c)
    dt = 2 * np.pi / (rate * root) / (samples * 200)
    with loaded(lonely_rods(alpha), tmp_path) as session:
        session.commands(f"{TILT}\n{drive(f'shear {rate}', dt)}")
        cosines = []
        for _ in range(samples):
            session.commands("run 200 post no")
            cosines.append(np.cos(2 * state_of(session).packing.orientation).mean())
        turned = fix_vector(session, "drive", 19)
    order = float(np.mean(cosines))
    measured(turn=abs(turned / -np.pi - 1), order=abs(order - (1 - root) / c))
    assert turned == pytest.approx(-np.pi, rel=1e-7)
    assert order == pytest.approx((1 - root) / c, abs=1e-7)


@pytest.mark.parametrize("rate", [0.02, -0.01])
def test_isolated_rods_align_with_pure_shear(rate, tmp_path, measured):
    alpha, dt, steps = 4.0, 0.005, 10_000
    along, across = mean_squares(alpha)
    c, strain = (along - across) / (along + across), rate * dt * steps
    packing = lonely_rods(alpha)
    with loaded(packing, tmp_path) as session:
        session.commands(f"{drive(f'pure {rate}', dt)}\nrun 0")
        start = unwrapped(session)
        session.commands(f"run {steps}")
        end, angle = unwrapped(session), state_of(session).packing.orientation
        told = fix_vector(session, "drive", 18)
    u = np.stack([np.cos(packing.orientation), np.sin(packing.orientation)])
    expected = np.arctan2(u[1] * np.exp(-c * strain), u[0] * np.exp(c * strain))
    error = np.abs((angle - expected + np.pi / 2) % np.pi - np.pi / 2).max()
    moved = np.abs(end / (start * np.exp([strain, -strain])) - 1).max()
    measured(angle=error, position=moved)
    assert error < 1e-8
    assert moved < 1e-13
    assert told == pytest.approx(strain, rel=1e-14)


def spinning(matrix, gradient, squares):
    """Rotations (3, 3) of a particle in a flow: <s x G s> = (<s^2> 1 - <s s>) w, nothing else."""
    Q = matrix.reshape(3, 3)
    second = Q @ np.diag(squares) @ Q.T
    moved = gradient @ second
    drag = np.array(
        [moved[2, 1] - moved[1, 2], moved[0, 2] - moved[2, 0], moved[1, 0] - moved[0, 1]]
    )
    w = np.linalg.solve(np.trace(second) * np.eye(3) - second, drag)
    return (np.cross(w, Q.T).T).ravel()


GRADIENT_3D = 0.01 * np.array([[0.3, 1.0, -0.4], [0.0, -0.5, 0.7], [0.0, 0.0, 0.1]])


def in_words(gradient):
    return "gradient " + " ".join(f"{g:.17g}" for g in np.ravel(gradient))


@pytest.mark.parametrize("semi_axes", [(1.0, 0.4, 0.4), (0.5, 1.0, 1.0), (0.9, 0.6, 0.4)])
def test_isolated_bodies_in_space_turn_as_their_moments_say(semi_axes, tmp_path, measured):
    """Jeffery's orbits, in a flow that shears all planes and stretches; spheroids and triaxial bodies."""
    rng, n, dt, steps = np.random.default_rng(3), 8, 0.02, 10_000
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    position = 8.0 * np.stack(np.unravel_index(np.arange(n), (2, 2, 2)), axis=1) - 4.0
    packing = Packing(
        position=position, orientation=q, diameters=np.tile(2 * np.array(semi_axes), (n, 1)),
        species=np.ones(n, int), id=np.arange(1, n + 1), box=Box(np.full(3, -8.0), np.full(3, 16.0)),
        shape_style="superellipsoid", exponent=np.ones(n),
    )  # fmt: skip
    with loaded(packing, tmp_path) as session:
        session.commands(f"{TILT}\n{drive(in_words(GRADIENT_3D), dt)}\nrun 0")
        start = unwrapped(session, packing)
        session.commands(f"run {steps}")
        end, quaternion = unwrapped(session, packing), state_of(session, packing).quaternion
    time, squares = dt * steps, np.array(semi_axes) ** 2 / 5
    error = 0.0
    for before, after in zip(rotations(packing.orientation), rotations(quaternion), strict=True):
        found = solve_ivp(lambda _, y: spinning(y, GRADIENT_3D, squares), (0, time), before.ravel(),
                          method="DOP853", rtol=1e-12, atol=1e-13)  # fmt: skip
        error = max(error, np.abs(found.y[:, -1].reshape(3, 3) - after).max())
    moved = np.abs(end - start @ expm(GRADIENT_3D * time).T).max() / 16.0
    measured(axes=error, position=moved)
    assert error < 1e-8
    assert moved < 1e-12


def rotations(q):
    """Matrices (N, 3, 3), body axes as columns."""
    w, i, j, k = q.T
    return np.moveaxis(np.array([
        [w*w + i*i - j*j - k*k, 2 * (i*j - w*k), 2 * (i*k + w*j)],
        [2 * (i*j + w*k), w*w - i*i + j*j - k*k, 2 * (j*k - w*i)],
        [2 * (i*k - w*j), 2 * (j*k + w*i), w*w - i*i - j*j + k*k],
    ]), -1, 0)  # fmt: skip


# --- compression is the isotropic case -----------------------------------------------------------


@pytest.fixture(scope="module")
def packings():
    return {2: dense(n=32, phi=0.9), 3: dense(3, alpha=2.0, n=32, phi=0.7)}


def run_flow(packing, folder, flow, *, dt=0.05, steps=200, before="", sides="two", options=""):
    """State after some steps."""
    with loaded(packing, folder, sides=sides, extra="box tilt large") as session:
        session.commands(f"{before}\n{drive(flow, dt, options)}\nrun {steps}")
        return state_of(session)


@pytest.mark.parametrize(
    "integrator", ["heun", "rkc2 tolerance 1e-3", "heun/adaptive tolerance 1e-3"]
)
@pytest.mark.parametrize("dimension", [2, 3])
def test_an_even_gradient_is_compression_to_the_last_bit(dimension, integrator, packings, tmp_path):
    kappa, options = 1.3e-4, f"integrator {integrator}"
    even = in_words(-kappa * np.eye(dimension))
    a = run_flow(packings[dimension], tmp_path, f"compress {kappa}", options=options)
    b = run_flow(packings[dimension], tmp_path, even, options=options)
    assert a.packing.position.tobytes() == b.packing.position.tobytes()
    assert a.quaternion.tobytes() == b.quaternion.tobytes()
    assert a.packing.box.matrix.tobytes() == b.packing.box.matrix.tobytes()


# --- the tilt and its flips ----------------------------------------------------------------------

# The tilts pass half an edge about step 1000 of 0.05.
SHEAR = {
    2: "shear 1e-2 compress 5e-5",
    3: in_words(1e-2 * np.array([[0.01, 1, 0.25], [0, 0, 1], [0, 0, -0.01]])),
}


def modulo_cell(packing, other):
    """Largest distance of two states' particles, images and cell vectors aside, over an edge."""
    apart = np.linalg.solve(packing.box.matrix, (packing.position - other.position).T)
    return np.abs(apart - np.round(apart)).max()


@pytest.mark.parametrize("steps", [600, 1012])
@pytest.mark.parametrize("dimension", [2, 3])
def test_forces_in_a_tilted_box_are_those_of_the_bindings(dimension, steps, packings, tmp_path):
    state = run_flow(packings[dimension], tmp_path, SHEAR[dimension], before=TILT, steps=steps)
    assert abs(state.packing.box.tilt[0]) > 0.2 * state.packing.box.edges[0]
    assert np.abs(state.force).max() > 1e-4
    assert difference_from_library(state, "two") < 1e-11


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("integrator", ["heun", "rkc2 tolerance 1e-4"])
def test_flips_change_nothing(dimension, integrator, packings, tmp_path, measured):
    """Flips of b, and in space of c along a and along b, beside the same run without any."""
    packing, options = packings[dimension], f"integrator {integrator}"
    keywords = {"before": TILT, "steps": 1012}
    flipped = run_flow(packing, tmp_path, SHEAR[dimension], options=options, **keywords)
    never = run_flow(packing, tmp_path, SHEAR[dimension], options=f"{options} flip 100", **keywords)
    a, b = flipped.packing.box.matrix, never.packing.box.matrix
    for k in range(dimension - 1):
        assert b[k, k + 1] > 0.5 * b[k, k]
        assert a[k, k + 1] < 0
    whole = np.linalg.solve(b, a)
    apart = modulo_cell(flipped.packing, never.packing)
    turned = angle_between(flipped.quaternion, never.quaternion).max()
    measured(position=apart, angle=turned, cell=np.abs(whole - np.round(whole)).max())
    np.testing.assert_allclose(whole, np.round(whole), rtol=0, atol=1e-13)
    assert apart < 1e-12
    assert turned < 1e-12


@pytest.fixture(scope="module")
def before_flip(packings, tmp_path_factory):
    """Restart files of both dimensions, 20 steps or so before their first flip."""
    folder = tmp_path_factory.mktemp("before_flip")
    for dimension, packing in packings.items():
        with loaded(packing, folder, sides="two") as session:
            session.commands(f"{TILT}\n{drive(SHEAR[dimension], 0.05)}\nrun 980")
            session.commands(f"write_restart {folder / str(dimension)}")
    return folder


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.validate)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_ranks_and_newton_change_nothing_across_flips(
    dimension, ranks, before_flip, tmp_path, measured
):
    found = {}
    for name, newton, on in (("one", "on", 1), ("many", "on", ranks), ("off", "off", ranks)):
        folder = tmp_path / name
        folder.mkdir()
        run_lmp_well(
            f"""{load_plugin()}
            newton {newton}
            processors {on} 1 1
            read_restart {before_flip / str(dimension)}
            {after_restart()}
            {drive(SHEAR[dimension], 0.05)}
            {dump(folder / "end.dump", every=1020)}
            run 1020 upto""",
            folder,
            on,
        )
        found[name] = rows_of_dump(folder / "end.dump")
    for name in ("many", "off"):
        position, quaternion = (np.abs(found[name][k] - found["one"][k]).max() for k in (0, 1))
        measured(**{f"{name}_position": position, f"{name}_quaternion": quaternion})
        assert position < 1e-12
        assert quaternion < 1e-12


def rows_of_dump(path):
    """Positions without images, and quaternions, of the last frame of a dump, by ID."""
    text = path.read_text().split("ITEM: TIMESTEP\n")[-1].splitlines()
    at = next(k for k, line in enumerate(text) if line.startswith("ITEM: BOX BOUNDS"))
    bounds = np.array([line.split() for line in text[at + 1 : at + 4]], float)
    xy, xz, yz = bounds[:, 2]
    lo = bounds[:, 0] - [min(0, xy, xz, xy + xz), min(0, yz), 0]
    hi = bounds[:, 1] - [max(0, xy, xz, xy + xz), max(0, yz), 0]
    matrix = np.diag(hi - lo)
    matrix[0, 1], matrix[0, 2], matrix[1, 2] = xy, xz, yz
    table = np.array([line.split() for line in text[at + 5 :]], float)
    table = table[np.argsort(table[:, 0])]
    return table[:, 2:5] + table[:, 5:8] @ matrix.T, table[:, 8:12]


@pytest.mark.parametrize("integrator", ["heun", "rkc2 tolerance 1e-4"])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("stop", [994, 1001, 1020])
def test_restarts_before_and_after_a_flip_go_on_as_if_never_stopped(
    stop, dimension, integrator, before_flip, tmp_path, measured
):
    text = f"{after_restart()}\n{drive(SHEAR[dimension], 0.05, f'integrator {integrator}')}"
    half = tmp_path / "half.restart"
    writing = f"restart {stop} {half} {tmp_path / 'end.restart'}"
    ends = []
    for begin, more in ((before_flip / str(dimension), writing), (half, "")):
        with restarted(begin, text) as session:
            session.commands(f"{more}\nrun {stop + 60} upto")
            assert session.step == stop + 60
            box, quaternion = session.lmp.extract_box()[:5], state_of(session).quaternion
            ends.append((np.hstack(box), unwrapped(session), quaternion))
    (box, *whole), (box_there, *second) = ends
    np.testing.assert_array_equal(box_there, box)
    # Forces are summed up in the order of the atoms, which the file does not keep.
    apart, turned = (np.abs(a - b).max() for a, b in zip(whole, second, strict=True))
    measured(position=apart, quaternion=turned)
    assert apart < 1e-12
    assert turned < 1e-12


def test_simple_shear_keeps_its_volume_for_a_strain_of_a_thousand(tmp_path, measured):
    packing = dense(alpha=1.0, n=8, phi=0.5)
    with loaded(packing, tmp_path, sides="one") as session:
        session.commands(f"{TILT}\n{drive('shear 0.4', 0.2)}\nrun 0")
        before = state_of(session).packing.box
        session.commands("run 12500")
        after = state_of(session).packing.box
        assert fix_vector(session, "drive", 17) == pytest.approx(1000, rel=1e-12)
    change = abs(np.linalg.det(after.matrix) / np.linalg.det(before.matrix) - 1)
    measured(volume=change)
    assert change < 1e-15
    assert abs(after.matrix[0, 1]) <= 0.5 * after.matrix[0, 0]


def test_rates_may_change_between_runs(packings, tmp_path):
    """Compressed, sheared, and compressed again: the cell is the product of the three."""
    packing, kappa, rate, dt, steps = packings[2], 1e-4, 2e-3, 0.05, 100
    flows = [f"compress {kappa}", f"shear {rate}", f"compress {-kappa} shear {rate}"]
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(TILT)
        for flow in flows:
            session.commands(f"{drive(flow, dt)}\nrun {steps}\nunfix drive")
        found = state_of(session).packing.box.matrix
    time, one, shear = dt * steps, np.eye(2), rate * np.eye(2, k=1)
    wanted = expm((kappa * one + shear) * time) @ expm(shear * time) @ expm(-kappa * one * time)
    np.testing.assert_allclose(found, wanted @ np.diag(packing.box.edges), rtol=0, atol=1e-13)


# --- pressure tensor and work --------------------------------------------------------------------


def to_and_fro(packing, folder, first, then, *, steps=400, integrator="rkc2"):
    """Run, change the gradient by `fix_modify`, run as long; end with the box and the elements of the fix."""
    with loaded(packing, folder, sides="two", extra="box tilt large") as session:
        session.commands(f"{TILT}\n{drive(first, 0.05, f'integrator {integrator}')}\nrun 0")
        start = session.lmp.extract_box()
        session.commands(f"run {steps}\nfix_modify drive {then}\nrun {steps}")
        return (
            start,
            session.lmp.extract_box(),
            [fix_vector(session, "drive", k) for k in range(1, 21)],
        )


@pytest.mark.parametrize("integrator", ["heun", "rkc2"])
@pytest.mark.parametrize(
    ("dimension", "flow", "back"),
    [
        (2, "shear 1e-3", "shear -1e-3"),
        (3, "shear 1e-3", "shear -1e-3"),
        (2, "pure 1e-3", "pure -1e-3"),
        (3, "compress -1e-4", "compress 1e-4"),
        (3, "gradient 1e-4 0 1e-3 0 0 0 0 0 0", "gradient -1e-4 0 -1e-3 0 0 0 0 0 0"),
    ],
)
def test_a_modified_flow_goes_on_from_the_strain(
    dimension, flow, back, integrator, packings, tmp_path
):
    start, end, vector = to_and_fro(
        packings[dimension], tmp_path, flow, back, integrator=integrator
    )
    np.testing.assert_allclose(np.hstack(end[:5]), np.hstack(start[:5]), rtol=0, atol=1e-15)
    assert vector[0] == pytest.approx(40.0, rel=1e-14)
    assert vector[1] == vector[16] == vector[17] == 0.0


@pytest.mark.parametrize(("dimension", "ranks"), in_turn([2, 3], [1, 2]))
def test_a_modified_flow_goes_on_after_flips(dimension, ranks, packings, tmp_path):
    """At a strain of 0.8, whose cell has other vectors, by `fix_modify` and after `read_restart` alike."""
    flow, restart, back = "shear 4e-2", tmp_path / "turned.restart", "shear -4e-2"
    with loaded(packings[dimension], tmp_path, extra="box tilt large") as session:
        session.commands(f"{TILT}\n{drive(flow, 0.1)}\nrun 0")
        start = session.lmp.extract_box()
        session.commands(f"run 200\nwrite_restart {restart}\nfix_modify drive {back}")
        session.commands("run 0\nrun 0\nrun 200")  # a run of no steps leaves the box as it is
        strain, end = fix_vector(session, "drive", 17), session.lmp.extract_box()
    assert strain == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(np.hstack(end[:5]), np.hstack(start[:5]), rtol=0, atol=1e-13)
    for change in (drive(back, 0.1), f"{drive(flow, 0.1)}\nfix_modify drive {back}"):
        said = run_lmp_well(
            f"""{load_plugin()}
            read_restart {restart}
            {after_restart()}
            {change}
            run 200
            print "strain $(f_drive[17])" """,
            tmp_path,
            ranks,
        )
        assert float(said.split("\nstrain ")[-1].split()[0]) == pytest.approx(0, abs=1e-15)


def test_a_modified_flow_is_checked_as_a_new_one(packings, tmp_path):
    for flow, then, sentence in (
        ("shear 1e-3 volume constant", "compress 1e-3", "trace is -0.002, expected a trace of 0"),
        ("shear 1e-3", "shear x", "x"),
        ("shear 1e-3", "gradient 1e-3 0 0", "gradient with 3 numbers, expected 4"),
        ("shear 1e-3", "drag 2", "fix_modify"),
    ):
        start = scene(packings[2], tmp_path / "start.data")
        text = f"{load_plugin()}\n{start}\n{TILT}\n{drive(flow, 0.01)}\nfix_modify drive {then}"
        assert sentence in error_of(run_lmp(text, tmp_path)), then
    text = f"{load_plugin()}\n{scene(packings[2], tmp_path / 'start.data')}\n{drive('pure 1e-3', 0.01)}"
    said = error_of(run_lmp(f"{text}\nfix_modify drive shear 1e-3", tmp_path))
    assert "a box without tilt, expected one that shear can tilt" in said


@pytest.mark.parametrize("dimension", [2, 3])
def test_stress_is_how_the_energy_changes_with_each_strain(dimension, packings, tmp_path, measured):
    """-V P_kj = dU / d(strain), particles moved with the box at fixed orientations."""
    step, volume = 1e-6, float(np.prod(packings[dimension].box.edges))
    places = {(0, 1): 16, (0, 2): 19, (1, 2): 20}
    with loaded(packings[dimension], tmp_path, sides="two", extra="box tilt large") as session:
        session.commands(
            f"compute p all packing\nthermo_style custom step pe c_p[1]\nthermo_modify norm no\n{TILT}\nrun 0"
        )
        vector = global_vector(session, "p")
        p, n_1, n_2 = vector[2], vector[14], vector[20]
        yy = p - n_1 / 2 if dimension == 2 else p + (n_2 - n_1) / 3
        tensor = {(0, 0): yy + n_1, (1, 1): yy, (2, 2): yy - n_2}
        tensor |= {at: vector[place - 1] for at, place in places.items()}
        worst = 0.0
        for k, j in itertools.combinations_with_replacement(range(dimension), 2):
            slope = energy_strained(session, k, j, step) - energy_strained(session, k, j, -step)
            worst = max(worst, abs(slope / (2 * step) + volume * tensor[k, j]) / (volume * p))
    measured(stress=worst)
    assert worst < 1e-7


def energy_strained(session, k, j, by):
    """U after x_k becomes x_k + `by` x_j, everything put back."""
    axes = "xyz"
    edges = np.array(session.lmp.extract_box()[1]) - np.array(session.lmp.extract_box()[0])
    name = axes[k] if k == j else axes[k] + axes[j]
    there = f"{name} scale {1 + by:.17g}" if k == j else f"{name} final {by * edges[j]:.17g}"
    back = f"{name} scale {1 / (1 + by):.17g}" if k == j else f"{name} final 0"
    session.commands(f"change_box all {there} remap units box\nrun 0 post no")
    energy = session.lmp.get_thermo("pe")
    session.commands(f"change_box all {back} remap units box")
    return energy


@pytest.mark.parametrize("dimension", [2, 3])
def test_power_balance_along_a_driven_run(dimension, packings, tmp_path, measured):
    """dU/dt = -V P:G - sum torque.w_host - what the drag takes, integrated by Simpson's rule."""
    packing, steps, every = packings[dimension], 400, 2
    dt = {2: 0.01, 3: 0.0025}[dimension]  # forces of twisted rods in space have kinks
    gradient = {2: np.array([[-1e-4, 2e-3], [0, 2e-4]]), 3: GRADIENT_3D / 5}[dimension]
    rows = []
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"{TILT}\n{drive(in_words(gradient), dt)}")
        session.commands(
            "compute p all packing\nthermo_style custom step pe vol c_p[1]\nthermo_modify norm no"
        )
        session.commands("run 2000\nrun 0")
        for k in range(steps // every + 1):
            rows.append(powers(session, gradient, dimension))
            if k < steps // every:
                session.commands(f"run {every} post no")
    energy, work, spin, drag = np.array(rows).T
    weights = np.ones(len(rows))
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    integral = (work + spin - drag) @ weights * dt * every / 3
    largest = max(np.abs(x @ weights).max() * dt * every / 3 for x in (work, spin, drag))
    error = abs(energy[-1] - energy[0] - integral) / largest
    measured(balance=error, spin=float(np.abs(spin).max() / np.abs(work).max()))
    assert np.abs(spin).max() > 1e-3 * np.abs(work).max()
    assert error < 1e-6


def powers(session, gradient, dimension):
    vector = global_vector(session, "p")
    p, n_1, n_2 = vector[2], vector[14], vector[20]
    yy = p - n_1 / 2 if dimension == 2 else p + (n_2 - n_1) / 3
    tensor = np.diag([yy + n_1, yy, yy - n_2])[:dimension, :dimension]
    tensor[0, 1] = vector[15]
    if dimension == 3:
        tensor[0, 2], tensor[1, 2] = vector[18], vector[19]
    volume = session.lmp.get_thermo("vol")
    work = -volume * float((tensor * gradient).sum())
    spin, drag = -fix_vector(session, "drive", 20), fix_vector(session, "drive", 5)
    return session.lmp.get_thermo("pe"), work, spin, drag


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("flow", "sentence"),
    [
        ("shear 1e-3", "a box without tilt, expected one that shear can tilt"),
        ("gradient 1e-3 0 0", "gradient with 3 numbers, expected 4"),
        ("gradient 0 0 1e-3 0", "below the diagonal, expected 0"),
        ("flip 0.4 shear 0", "flip 0.4, expected a fraction of an edge, at least 0.5"),
        (
            "gradient 1e-3 0 0 1e-3 volume constant",
            "trace is 0.002, expected a trace of 0",
        ),
        ("compress 1e-3 volume constant", "trace is -0.002, expected"),
        ("shear 0 volume fixed", "'volume fixed', expected"),
        ("shear", "shear without a number, expected a rate"),
        ("twist 3", "'twist 3', expected"),
    ],
)
def test_flows_that_cannot_be_are_refused(flow, sentence, sentence_of_flow):
    assert sentence in sentence_of_flow(flow)


@pytest.fixture
def sentence_of_flow(packings, tmp_path):
    def sentence(flow):
        text = (
            f"{load_plugin()}\n{scene(packings[2], tmp_path / 'start.data')}\n{drive(flow, 0.01)}"
        )
        return error_of(run_lmp(f"{text}\nrun 0", tmp_path))

    return sentence
