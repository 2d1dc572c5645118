"""Central differences of the energy that the binding returns."""

from __future__ import annotations

import numpy as np
from reference_energy import Approach, least_fade_length
from spherocylinder_pairs import EPS, energies, turned

# Steps of this many d: short enough to straddle the switch of a clamped foot, where the second
# derivative jumps, at no cost. Differences over several steps are fitted by a constant and a square,
# which removes the error of second order and averages rounding.
STEP = 7e-8
MULTIPLES = np.linspace(1.0, 3.0, 9)
# Of the least length over which a second bond fades in.
STEP_IN_FADE = 1e-4


def fit_weights():
    """Weights of the slopes in their value at step zero; a slope's rounding is inverse to its step."""
    columns = np.column_stack([np.ones_like(MULTIPLES), MULTIPLES**2])
    return np.linalg.pinv(columns * MULTIPLES[:, None])[0] * MULTIPLES


def is_clear_of_fade(pairs):
    """Within the steps no second bond, or one that does not fade by length.

    Fading by cosine and by depth takes long against any step.
    """
    x = Approach(pairs)
    margin = 10.0 * STEP * pairs.d / x.fade_length
    no_length = np.minimum(pairs.A_i, pairs.A_j) == 0.0
    no_second = (x.far_overlap < -10.0 * STEP) | (x.opposite == 0.0)
    return no_length | no_second | (x.steps[0] > 1.0 + margin)


def step_lengths(pairs, sides):
    step = STEP * pairs.d
    if sides == 1:
        return step
    in_fade = STEP_IN_FADE * least_fade_length(pairs)
    return np.where(is_clear_of_fade(pairs), step, np.minimum(step, in_fade))


def rounding_of_differences(pairs, sides):
    """Error of the differences from the rounding of coordinates, relative to the force."""
    return EPS * pairs.extent / step_lengths(pairs, sides)


def displacements(pairs):
    """One function (step) -> (moved pairs, step really taken) per coordinate, and its lever arm."""

    def translation(component):
        def move(step):
            r = pairs.r.copy()
            r[:, component] += step
            return pairs.replaced(r=r), r[:, component] - pairs.r[:, component]

        return move

    def rotation(axis, component):
        def move(step):
            return pairs.replaced(**{axis: turned(getattr(pairs, axis), step, component)}), step

        return move

    rotations = 1 if pairs.dimension == 2 else 3
    by_r = [(translation(c), np.ones(len(pairs))) for c in range(pairs.dimension)]
    by_i = [(rotation("u_i", c), pairs.A_i + pairs.d) for c in range(rotations)]
    by_j = [(rotation("u_j", c), pairs.A_j + pairs.d) for c in range(rotations)]
    return by_r, by_i, by_j


def central_differences(pairs, sides, k_e):
    """Derivatives by r, by rotations of i and by rotations of j, one array each."""

    def derivative(move, lever):
        fitted = np.zeros(len(pairs))
        for multiple, fit_weight in zip(MULTIPLES, fit_weights(), strict=True):
            step = multiple * step_lengths(pairs, sides) / lever
            (forth, ahead), (back, behind) = move(step), move(-step)
            rise = energies(forth, sides, k_e) - energies(back, sides, k_e)
            fitted += fit_weight * rise / (ahead - behind)
        return fitted

    return tuple(
        np.column_stack([derivative(*displacement) for displacement in group])
        for group in displacements(pairs)
    )


def one_sided_differences(pairs, sides, k_e):
    """Derivatives from the left and from the right, each as central_differences returns them."""
    at_rest = energies(pairs, sides, k_e)

    def derivative(move, lever, direction):
        step = direction * 5.0 * STEP * pairs.d / lever
        (near, _), (far, twice) = move(step), move(2.0 * step)
        rise = 4.0 * energies(near, sides, k_e) - energies(far, sides, k_e) - 3.0 * at_rest
        return rise / twice

    return tuple(
        tuple(
            np.column_stack([derivative(*displacement, direction) for displacement in group])
            for group in displacements(pairs)
        )
        for direction in (-1.0, 1.0)
    )


def outside(gradient, left, right):
    """Distance of each component of `gradient` from the interval of the one-sided ones."""
    above = gradient - np.maximum(left, right)
    below = np.minimum(left, right) - gradient
    return np.maximum(np.maximum(above, below), 0.0)
