"""Two particles that meet in a shear: LAMMPS and implicit steps against an independent integration.

The reference knows forces from the bindings, which have their own oracles, and integrates the equations of motion as they are
printed, without boxes, by a method of eighth order.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jamshape as js
from jamshape.flow.implicit import Flow, follow
from jamshape.flow.slow_shear import SlowShear
from jamshape.landscape import Landscape, State

GDOT, STRAIN, EDGE = 1e-2, 4.0, 60.0
CASES = {
    "discs": (0.0, [0.3, 0.9]),
    "nearly round": (0.01, [0.3, 0.9]),
    "rods": (4.0, [0.4, 1.1]),
    "equal rods side to side": (4.0, [0.02, 0.03]),
}


def meeting(alpha, angles):
    """Two particles, the upper one to the left: the flow drives it over the lower one."""
    length = 1 + alpha
    y, reach = (0.3, 1.6) if alpha < 1 else (0.5, 5.5)
    return js.Packing(
        position=[[0.5 * EDGE - reach, 0.5 * EDGE + y], [0.5 * EDGE, 0.5 * EDGE - y]],
        orientation=angles,
        diameters=[[length, 1, 1], [1.4 * length, 1.4, 1.4]],
        species=[1, 2], id=[1, 2], box=js.Box(lo=[0, 0], edges=[EDGE, EDGE]),
    )  # fmt: skip


def reference(packing):
    """Positions (2, 2) and angles (2,) in the end, relative to the second particle's centre."""
    landscape = Landscape(packing)
    area, moment = landscape.bodies.measure, landscape.bodies.moment
    c = (moment[:, 1] - moment[:, 0]) / moment[:, 2]
    scale = np.where(landscape.rotation_length > 0, landscape.rotation_length, 1.0)

    cell = State.of(packing).cell

    def rates(_, values):
        position, angle = values[:4].reshape(2, 2), values[4:]
        state = State(np.longdouble(position), np.longdouble(angle[:, None]), cell)
        slope = landscape.components(landscape.evaluate(state).gradient)
        velocity = -slope[:, :2] / area[:, None]
        velocity[:, 0] += GDOT * position[:, 1]
        turn = -slope[:, 2] * scale / (area * moment[:, 2])
        turn -= 0.5 * GDOT * (1 - c * np.cos(2 * angle))
        return np.concatenate([velocity.ravel(), turn])

    begun = np.concatenate([packing.position.ravel(), packing.orientation])
    # Contacts open and close: no step leads over that.
    done = solve_ivp(
        rates, (0, STRAIN / GDOT), begun, "DOP853", rtol=1e-10, atol=1e-10, max_step=2.0
    )
    assert done.success
    end = done.y[:, -1]
    return end[:2] - end[2:4], end[4:], done


def apart(position, box):
    offset = box.fractions((position[0] - position[1])[None])[0]
    return box.vectors((offset - np.rint(offset))[None])[0]


@pytest.mark.lammps
@pytest.mark.parametrize("name", CASES)
def test_both_follow_the_orbit_of_two_particles(name, tmp_path, measured):
    start = meeting(*CASES[name])
    separation, angles, _ = reference(start)
    # They met: nothing but the host would leave them elsewhere.
    lonely = start.position[0] - start.position[1]
    lonely[0] += STRAIN * lonely[1]
    assert abs(separation[1] - lonely[1]) > 0.05
    run = js.shear(start=start, gdot=GDOT, strain=STRAIN, integrator="rkc2", integration_tolerance=1e-8, rows=50,
                   file=tmp_path / "a.h5", progress=False)  # fmt: skip
    flow = Flow(State.of(start))
    list(
        follow(
            Landscape(start),
            flow,
            SlowShear(gdot=GDOT, strain_end=STRAIN, tolerance=1e-4, largest_strain=1e-2),
        )
    )
    turns = Landscape(start).rotation_length > 0
    for way, bound in (("lammps", 1e-6), ("implicit", 1e-4)):
        end = run.packing(-1) if way == "lammps" else flow.state.packing(start)
        off = np.abs(apart(end.position, end.box) - separation).max()
        turned = (end.orientation - angles + np.pi / 2) % np.pi - np.pi / 2
        measured(**{f"{way}_off": off, f"{way}_turned": np.abs(turned[turns]).max(initial=0)})
        assert off < bound
        assert (np.abs(turned[turns]) < bound).all()
