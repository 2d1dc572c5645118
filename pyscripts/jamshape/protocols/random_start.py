"""Random initial states in a periodic box, with or without overlaps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import RANGES, Sentence, require_in, require_one_of, require_stated
from jamshape.packing import Box, Packing
from jamshape.packing.plain import unturned
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction

# Safe fraction of the packing fraction where insertion stalls: the long
# particles, placed first, fill their share of a box that is too small better than all do together.
_SAFE = 0.85


# Packing fraction with room for long particles, over their width divided by their length: in 2D to insert them, in 3D to
# push them apart without a jam.
_ROOM = {2: 3.55, 3: 1.75}

# Packing fractions to try for starts of compressions.
_DENSEST, _LOOSEST = (0.4, 0.2, 0.1, 0.05), 0.02


class InsertionError(Sentence, ValueError):
    """Random insertion did not find room for all particles; parameters as in `Sentence`."""

    def of(self, **given: Any) -> InsertionError:
        """Return the same error of another argument than ``phi``, such as ``phi_start=0.4``."""
        (name,) = given
        return InsertionError(self.template.replace("{phi:name}", f"{{{name}:name}}"), given)


def random_packing(
    n: int, phi: float, seed: int, particles: Particles | None = None, dimension: int = 2
) -> Packing:
    """Place particles at random, one after another, without overlaps.

    Parameters
    ----------
    n : int
    phi : float
        Packing fraction; the periodic box is a square (cube) with exactly this value.
    seed : int
        Random seed for `numpy.random.default_rng`; the same arguments give the same packing.
    particles : Particles, optional
        ``Particles.of()`` by default.
    dimension : {2, 3}

    Returns
    -------
    Packing
        No two surfaces overlap and no spines cross, including periodic images. Orientations are
        uniform on the circle (sphere). IDs are independent of size.

    Raises
    ------
    InsertionError
        If there is no room: random insertion stops far below jamming, at about phi = 0.5 for rods
        with alpha = 4 in 2D; or if the box is too short for the longest particle.
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> from jamshape.protocols.random_start import random_packing
    >>> round(random_packing(n=20, phi=0.3, seed=1).phi, 12)
    0.3
    """
    unplaced, rng = _unplaced(n, phi, seed, (particles or Particles.of(), dimension))
    # Long particles are placed first, while there is room; short ones fit into gaps.
    first = np.argsort(-unplaced.outer_radius, kind="stable")
    sizes = unplaced.diameters[first], unplaced.form[first]
    bodies = unplaced.shape.compiled(sizes, dimension, unplaced.law)
    box = _box(float(np.sum(bodies.measure)), phi, dimension)
    found = bodies.insert(
        box.edges,
        lambda m: rng.random((m, dimension)),
        lambda m: _random_orientations(m, dimension, rng).reshape(m, -1),
    )
    if found["outcome"] != "all":
        raise _refusal(bodies, box, found)
    order = rng.permutation(n)  # independent of the order of insertion
    names = ("diameters", "form", "species")
    return unplaced.with_(
        box=box,
        position=found["position"][order],
        orientation=found["orientation"][order].reshape(unplaced.orientation.shape),
        **{name: getattr(unplaced, name)[first[order]] for name in names},
    )


def start_below(
    phi: float, n: int, seed: int, particles: Particles | None = None, dimension: int = 2
) -> Packing:
    """Make a random packing to compress to phi, as dense as random insertion allows.

    Arguments and errors as in `random_packing`.
    """
    room = usual_phi_start(_DENSEST[0], n, seed, particles or Particles.of(), dimension)
    for densest in (room, *(one for one in _DENSEST if one < room)):
        with suppress(InsertionError):
            return random_packing(n, min(phi, densest), seed, particles, dimension)
    return random_packing(n, min(phi, _LOOSEST), seed, particles, dimension)


def compression_start(
    n: int, phi_start: float, seed: int, particles: Particles, dimension: int
) -> Packing:
    """Make a random packing as `random_packing`, whose errors then name ``phi_start``."""
    try:
        return random_packing(n, phi_start, seed, particles, dimension)
    except InsertionError as error:
        raise error.of(phi_start=phi_start) from None


def usual_phi_start(
    densest: float, n: int, seed: int, particles: Particles, dimension: int
) -> float:
    """Return a packing fraction to start compressions from: `densest`, or a smaller one of particles that are long.

    The area (volume) that a rod excludes grows with the square of its length, so that its neighbours block it from a packing
    fraction on that is proportional to its width over its length. This ratio is estimated from the area of a particle over
    that of the circle around it, and in 3D from the square root of the fraction of the sphere.
    """
    unplaced, _ = _unplaced(n, densest, seed, (particles, dimension))
    balls = np.pi / (1.0 if dimension == 2 else 0.75) * unplaced.outer_radius**dimension
    width_over_length = (math.fsum(unplaced.measures) / math.fsum(balls)) ** (1 / (dimension - 1))
    return min(densest, float(f"{_ROOM[dimension] * width_over_length:.2g}"))


def dilute_packing(
    n: int, phi: float, seed: int, particles: Particles | None = None, dimension: int = 3
) -> Packing:
    """Place particles at random with random orientations, allowing overlaps.

    Yuan et al. 2019, Sec. 2.2. Arguments and errors as in `random_packing`; in dilute packings overlaps
    are few and small, and the first minimisation undoes them.
    """
    unplaced, rng = _unplaced(n, phi, seed, (particles or Particles.of(), dimension))
    box = _box(math.fsum(unplaced.measures), phi, dimension)
    orientation = _random_orientations(n, dimension, rng)
    position = rng.uniform(0, box.edges[0], (n, dimension))
    return unplaced.with_(box=box, position=position, orientation=orientation)


def _unplaced(
    n: int, phi: float, seed: int, of: tuple[Particles, int]
) -> tuple[Packing, np.random.Generator]:
    """Draw particles, without poses, in a unit box."""
    particles, dimension = of
    require_in("phi", phi, RANGES["phi_start"])
    require_one_of("dimension", dimension, (2, 3))
    require_stated(n=n, seed=seed)
    rng = np.random.default_rng(seed)
    sizes = particles.sample(n, rng)
    unplaced = Packing(
        position=np.zeros((n, dimension)),
        orientation=unturned(n, dimension),
        diameters=sizes.diameters,
        form=sizes.form,
        species=sizes.species,
        id=1 + np.arange(n),
        box=Box(lo=np.zeros(dimension), edges=np.ones(dimension)),
        shape_style=particles.shape.name,
        law=Interaction(power=particles.power),
    )
    return unplaced, rng


def _box(area: float, phi: float, dimension: int) -> Box:
    """Return the box in which particles of that area (volume) have the packing fraction phi."""
    edge = (area / phi) ** (1 / dimension)
    return Box(np.zeros(dimension), np.full(dimension, edge))


def _refusal(bodies: Any, box: Box, found: Mapping[str, Any]) -> InsertionError:
    """Explain why bodies, the longest first, found no room, and suggest another start."""
    measure = np.array(bodies.measure)
    phi = float(np.sum(measure)) / box.volume
    if found["outcome"] == "too short":
        length, edge = 2 * bodies.outer_radius[0], box.edges[0]
        fits = phi * (edge / length) ** box.dimension
        return InsertionError(
            f"no direction keeps the longest particle, of length {length:.3g}, off its"
            f" own periodic images in a box of edge {edge:.3g}: start at {{phi:name}} <= {_SAFE * fits:.2g}"
            " and compress from there, or take more particles",
            {"phi": phi},
        )
    measure[found["waiting"]] = 0
    reached = measure.sum() / box.volume
    return InsertionError(
        f"random insertion of {len(measure)} particles stalled at phi = {reached:.3g} of the"
        f" {phi:.3g} requested after {found['attempts']} attempts: start at"
        f" {{phi:name}} <= {_SAFE * reached:.2g} and compress from there",
        {"phi": phi},
    )


def _random_orientations(n: int, dimension: int, rng: np.random.Generator) -> FloatArray:
    """Uniform angles (n,) in 2D, uniform unit quaternions (n, 4) in 3D."""
    if dimension == 2:
        return rng.uniform(0, 2 * np.pi, n)
    quaternions = rng.normal(size=(n, 4))
    unit: FloatArray = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit
