"""Criteria of a minimum: its eigenvalues, and the energies of its neighbours.

In two dimensions. A mode that no bond resists to quadratic order has an eigenvalue of the first order in
the overlap, or, if it is a rod that slides along its flat side, of the second: 1e-8 and 1e-16 at
u = 1e-15. Eigenvalues of the dense Hessian are known to `Eigen.rounding`, about 1e-13, only; `unconstrained`
finds those of the soft modes to all their digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape.minima import Outcome, rounding_floor

EPS = np.finfo(float).eps
LONG_EPS = float(np.finfo(np.longdouble).eps)

# Modes that bonds resist less than this, of the stiffest, are looked at as unconstrained.
_SOFT = 1e-6

# Of a bond's force: what a rattler that is barely touched may bear.
_TOUCH = 1e-6

# Of a bond's force: what may be left of forces where rods have not slid to their end.
_SLIDING = 1e-5

# Eigenvalues of the second order in the overlap, over its square: up to 3 were found, of either sign.
_SECOND_ORDER = 20.0

TOLERANCE = 1e-8
SIZES = (1e-2, 1e-1, 1.0, 1e1, 1e2)


class Eigen(NamedTuple):
    """Ascending eigenvalues, what rounding makes of a zero, and their modes if they are known."""

    values: np.ndarray
    rounding: float
    modes: np.ndarray | None = None


def typical_overlap(landscape, state):
    """Mean overlap of the bonds, a length."""
    d = 2 * float(landscape.particles.radius.mean())
    return landscape.evaluate(state).bond_force * d**2 / landscape.k_e


def dense(landscape, state):
    """Eigenvalues and modes of the Hessian, rattlers included."""
    hessian = landscape.curvature(state, extended=True).hessian.toarray()
    values, modes = np.linalg.eigh(hessian)
    return Eigen(values, len(values) * EPS * values[-1], modes)


def _held(landscape, state):
    """Flag particles other than rattlers; return all contacts, and those between these particles."""
    rattlers = landscape.rattlers(state)
    found = landscape.derivatives(state, extended=True)
    return ~rattlers, found, ~rattlers[found["particles"]].any(axis=1)


def force_on_rattlers(landscape, state):
    """Largest force of a contact with a rattler, over the mean force of contacts."""
    _, found, held = _held(landscape, state)
    force = np.linalg.norm(found["force"], axis=1)
    return force[~held].max(initial=0.0) / force.mean()


def _backbone(landscape, state):
    """Stiff and soft part of the Hessian without rattlers: (B, n) rows of the bonds, (n, n)."""
    backbone, found, held = _held(landscape, state)
    found = {name: values[held] for name, values in found.items()}
    soft = landscape._summed(found["curvature"], landscape._places(found)).toarray()

    contact, slot = np.nonzero(found["stiffness"])
    i, j = found["particles"][contact].T
    slope = found["gradient"][contact, slot]
    rows = np.zeros((len(contact), landscape.particles.n, landscape.components(soft[0]).shape[1]))
    bond = np.arange(len(contact))
    np.add.at(rows, (bond, i, slice(0, 2)), slope[:, :2])
    np.subtract.at(rows, (bond, j, slice(0, 2)), slope[:, :2])
    length = np.where(landscape.rotation_length > 0, landscape.rotation_length, 1.0)
    np.add.at(rows, (bond, i, 2), slope[:, 2] / length[i])
    np.add.at(rows, (bond, j, 2), slope[:, 3] / length[j])
    free = landscape.components(np.ones(landscape.size)) > 0
    stiff = np.sqrt(found["stiffness"][contact, slot])[:, None] * rows[:, free]
    kept = backbone[landscape.particle_of_coordinate()]
    return stiff[:, kept], soft[np.ix_(kept, kept)]


def unconstrained(landscape, state):
    """Eigenvalues of the Hessian of the backbone along its soft modes, to the digits of the overlap.

    Marschall & Teitel 2018, Appendix B: where bonds resist no motion, what is left is the prestress,
    less what the stiff modes give way. The number of negative ones is that of the whole Hessian
    (Haynsworth's inertia), while the values are those of the soft modes up to terms of a higher order.
    """
    stiff, soft = _backbone(landscape, state)
    _, singular, modes = np.linalg.svd(stiff)
    stiffness = np.zeros(len(modes))
    stiffness[: len(singular)] = singular**2
    weak = stiffness < _SOFT * stiffness.max()
    Y, Z = modes[~weak].T, modes[weak].T
    coupling = Z.T @ soft @ Y
    hard = np.diag(stiffness[~weak]) + Y.T @ soft @ Y
    left = np.diag(stiffness[weak]) + Z.T @ soft @ Z - coupling @ np.linalg.solve(hard, coupling.T)
    values = np.linalg.eigvalsh((left + left.T) / 2)
    return Eigen(values, len(modes) * EPS * max(np.abs(soft).max(), EPS * stiffness.max()))


def count_sliders(landscape, state):
    """Count rods that only tips hold, on their flat sides: they slide at no cost at all."""
    curvature = landscape.curvature(state, extended=True)
    hessian, particles = curvature.hessian, landscape.particles
    count = 0
    for i in np.flatnonzero((particles.half_length > 0) & ~landscape.rattlers(state)):
        shift = np.zeros((particles.n, 3))
        shift[i, :2] = (
            np.cos(float(state.orientation[i, 0])),
            np.sin(float(state.orientation[i, 0])),
        )
        free = landscape.components(np.ones(landscape.size)) > 0
        count += np.abs(hessian @ shift[free]).max() < landscape.size * EPS
    return int(count)


class Probe(NamedTuple):
    """A neighbour: how much higher it is, how steep it is from there, and how well both are known."""

    rise: float
    slope: float
    rise_error: float
    slope_error: float

    @property
    def is_lower(self):
        """Whether it is lower, or would be a little further, beyond errors."""
        return self.rise < -self.rise_error or self.slope < -self.slope_error

    @property
    def is_higher(self):
        """Whether it is higher beyond errors."""
        return self.slope > self.slope_error and self.rise > -self.rise_error


def allowed_residual(minimum):
    """Allowed residual force, over that of a bond."""
    return TOLERANCE if minimum.outcome is Outcome.CONVERGED else _SLIDING


def probe(landscape, minimum, step):
    """Compare a neighbour; errors are those of rounding and of what the residual leaves of forces."""
    here = minimum.evaluation
    there = landscape.evaluate(landscape.displaced(minimum.state, step))
    size = np.abs(step).sum()
    force = here.bond_force
    left = allowed_residual(minimum) * force * size
    rounding = 4 * LONG_EPS * here.n_bonds * float(landscape.particles.radius.max()) * force
    noise = rounding_floor(here, landscape) * force * size
    return Probe(
        rise=there.energy - here.energy,
        slope=float(there.gradient @ step),
        rise_error=left + rounding,
        slope_error=left + noise,
    )


def probes(landscape, minimum, directions, sizes=SIZES):
    """Probe along (K, n) directions, forwards and back, at sizes in typical overlaps.

    The largest component of a step is the size.
    """
    overlap = typical_overlap(landscape, minimum.state)
    for direction in directions:
        unit = direction / np.abs(direction).max()
        for size in sizes:
            for sign in (1, -1):
                yield probe(landscape, minimum, sign * size * overlap * unit)


def random_directions(landscape, number, seed=1):
    """Draw directions alike in all coordinates."""
    return np.random.default_rng(seed).normal(size=(number, landscape.size))


def soft_directions(landscape, state, number):
    """Find the softest modes of the backbone, translations left out."""
    curvature = landscape.curvature(state, extended=True)
    kept = ~landscape.rattlers(state)[landscape.particle_of_coordinate()]
    hessian = curvature.hessian.toarray()[np.ix_(kept, kept)]
    shifts = np.eye(3)[:2, None, :].repeat(landscape.particles.n, axis=1)
    free = landscape.components(np.ones(landscape.size)) > 0
    shifts = shifts[:, free][:, kept]
    shifts /= np.linalg.norm(shifts, axis=1, keepdims=True)
    _, modes = np.linalg.eigh(hessian + 10 * np.abs(hessian).max() * shifts.T @ shifts)
    directions = np.zeros((min(number, len(modes) - 2), landscape.size))
    directions[:, kept] = modes.T[: len(directions)]
    return directions


def complaints(landscape, minimum, n_random=10, n_soft=20):
    """List all evidence against a minimum with no zero modes but the known ones."""
    said = []
    state = minimum.state
    if landscape.rattlers(state).all():
        return ["nothing is held"]
    if (force := force_on_rattlers(landscape, state)) > _TOUCH:
        said.append(f"force {force:.2g} on a rattler")
    if minimum.residual.largest > allowed_residual(minimum):
        said.append(f"residual {minimum.residual.largest:.2g}")
    eigen = dense(landscape, state)
    if eigen.values[0] < -eigen.rounding:
        said.append(f"eigenvalue {eigen.values[0]:.2g} of the Hessian")
    soft = unconstrained(landscape, state)
    second = _SECOND_ORDER * typical_overlap(landscape, state) ** 2
    if soft.values[0] < -(soft.rounding + second):
        said.append(f"eigenvalue {soft.values[0]:.2g} of a soft mode")
    n_zero = int((np.abs(soft.values) <= soft.rounding).sum())
    n_expected = 2 + count_sliders(landscape, state)
    if n_zero != n_expected:
        said.append(f"{n_zero} zero modes where {n_expected} are expected")
    random = list(probes(landscape, minimum, random_directions(landscape, n_random)))
    if n_not := sum(not p.is_higher for p in random):
        said.append(f"{n_not} of {len(random)} random neighbours are not higher")
    along = list(probes(landscape, minimum, soft_directions(landscape, state, n_soft)))
    if n_lower := sum(p.is_lower for p in along):
        said.append(f"{n_lower} of {len(along)} neighbours along soft modes are lower")
    return said
