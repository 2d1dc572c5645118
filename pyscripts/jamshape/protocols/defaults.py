"""Default recipes of packings."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from jamshape.checks import (
    RANGES,
    ArgumentError,
    require_in,
    require_no_effect,
    require_one_of,
    require_stated,
    require_with,
)
from jamshape.files.vocabulary import ATHERMAL, COMPRESSED, THERMAL, protocol_named
from jamshape.minima import METHODS
from jamshape.minima.boxes import FIXED, FREE, ISOTROPIC, Yielding
from jamshape.minima.target import Target
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.random_start import usual_phi_start
from jamshape.protocols.recipe import (
    Adaptive,
    Compressed,
    Dynamics,
    Recipe,
    Steps,
    Thermalisation,
    Way,
)
from jamshape.protocols.source import Source
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import HARMONIC, Interaction, law_text

# Largest residual of a minimum before the search for an energy.
_TIGHT = 1e-8

Values = Mapping[str, Any]
"""Settings of a recipe by name."""

_COARSE = 1e-2  # largest step of the packing fraction, far below jamming
_ROUGH = 1e-2  # residual that suffices before the search for an energy

# Energy tolerance over the squared step, [energy]: a step adds ten to a hundred times as much to a jammed packing.
_LOOSE = 2.5e-3

_IN_BETWEEN = (
    1e-8  # energy density near which compression hands over, where the target is not an energy
)

_LAMBDA = 1e-6  # initial one of bisection (Marschall & Teitel 2018, Sec. III C)


class UsualProtocol(NamedTuple):
    """A protocol: its settings with defaults, and its construction from them.

    Settings without a default are refused.
    """

    compose: Callable[[Values], tuple[Way, Target | None]]
    """Builds it from the values of all its settings."""
    usual: Values
    in_plane: Values = MappingProxyType({})
    """Defaults that differ in 2D."""

    def defaults(self, dimension: int) -> dict[str, Any]:
        """Return the defaults of all its settings."""
        return dict(self.usual) | (dict(self.in_plane) if dimension == 2 else {})


def _of_law(get: Values, energy: float) -> float:
    """Return the energy of the recipe's contacts that has the overlaps of harmonic ones of an energy."""
    return energy * Interaction(power=get["power"]).over_harmonic(energy)


def _by_dynamics(get: Values) -> tuple[Way, Target | None]:
    if get["power"] != HARMONIC:
        msg = (
            f"the protocol dynamics has pressures of harmonic contacts, found the law {law_text(get['power'])}; take the"
            " protocol quasistatic or marschall-2018"
        )
        raise ValueError(msg)
    way = Dynamics(Approach(kappa=get["kappa"], p_end=get["p_end"]))
    return way, _target(get, get["tolerance"])


def _by_steps(get: Values) -> tuple[Way, Target | None]:
    energy = _of_law(get, Quasistatic.energy)
    quasistatic = Quasistatic(step=get["delta_phi"], energy=energy, tolerance=get["tolerance"])
    thermal = Thermalisation(get["phi_thermal"], get["n_sweeps"]) if "n_sweeps" in get else None
    return Steps(quasistatic, thermal), _target(get, min(get["tolerance"], _TIGHT))


def _by_adaptive_steps(get: Values) -> tuple[Way, Target | None]:
    step, tolerance = get["delta_phi"], get["tolerance"]
    coarse = max(_COARSE, step)
    rough = _ROUGH if get["u0"] else tolerance
    energy = _of_law(get, _LOOSE * step**2 if get["u0"] else Quasistatic.energy)
    quasistatic = Quasistatic(step=step, energy=energy, tolerance=rough, coarse=coarse)
    return Adaptive(quasistatic), _target(get, tolerance)


def _by_compression(get: Values) -> tuple[Way, Target | None]:
    way = Compressed(get["kappa"], get["phi_end"], get["search"], get["start"])
    target, minimiser = _target(get, get["tolerance"]), get["minimiser"] or "auto"
    if way.search == "extrapolation":
        if get["minimiser"] is not None:
            said = "{minimiser} has no effect with the search extrapolation, expected the search bisection"
            raise ArgumentError(said, {"minimiser": minimiser})
        return way, target
    require_one_of("minimiser", minimiser, METHODS)
    return way, target and dataclasses.replace(target, step=_LAMBDA, method=minimiser)


def _target(get: Values, tolerance: float) -> Target | None:
    return Target(get["u0"], get["accuracy"], tolerance) if get["u0"] else None


_ATHERMAL = UsualProtocol(
    _by_steps,
    {"n": 400, "phi_start": 0.1, "tolerance": 1e-4, "u0": 0.0, "accuracy": 1e-7, "delta_phi": 1e-3},
    {"n": 256, "phi_start": 0.4},
)

PROTOCOLS: dict[str, UsualProtocol] = {
    "quasistatic": UsualProtocol(
        _by_adaptive_steps,
        {
            "n": 400, "phi_start": 0.1, "tolerance": 1e-8, "u0": 1e-12, "accuracy": 1e-7,
            "delta_phi": 2e-3,
        },
        {"n": 256, "phi_start": 0.4, "u0": 1e-15},
    ),
    "dynamics": UsualProtocol(
        _by_dynamics,
        {
            "n": 256, "phi_start": 0.1, "tolerance": 1e-8, "u0": 1e-15, "accuracy": 1e-7,
            "kappa": 4e-7, "p_end": 1e-3,
        },
        {"phi_start": 0.4},
    ),
    "steps": _ATHERMAL,
    COMPRESSED: UsualProtocol(
        _by_compression,
        {
            "n": 1024, "phi_start": 0.1, "tolerance": 1e-8, "u0": 1e-15, "accuracy": 1e-7,
            "kappa": 1e-6, "phi_end": 0.8, "start": None, "search": "extrapolation", "minimiser": None,
        },
        {"phi_start": 0.4, "phi_end": 0.95},
    ),
    ATHERMAL: _ATHERMAL,
    THERMAL: _ATHERMAL._replace(
        usual=dict(_ATHERMAL.usual) | {"phi_thermal": 0.55, "n_sweeps": 100_000}
    ),
}  # fmt: skip
"""Adaptive quasistatic steps, the default; slow compression in LAMMPS; equal quasistatic steps; and published protocols,
with the values of the papers where given.

marschall-2018: N = 1024 and phi_init = 0.4 (Marschall & Teitel 2018, Sec. III B), a fixed rate, theirs being
1e-6 to 1e-10; U_0/L^2 = 1e-15 to 1e-7 of itself (Sec. III C, Eq. 20). Their final packing fraction is not given.
yuan-2019-1: N = 400, Delta phi = 1e-3, forces balanced to 1e-4, the first packing with U/N > 1e-10 (Yuan et al.
2019, Sec. 2.2); yuan-2019-2 with Monte Carlo at phi_i = 0.55, whose N_s they vary.
Each paper has one dimension; in the other, N is that of the paper or the default, and starts are as dense as possible.
"""


def recipe_for(
    particles: Particles | None = None,
    dimension: int | None = None,
    seed: int | None = None,
    protocol: int | str | None = None,
    **given: Any,
) -> Recipe:
    """Make a recipe from the given settings and defaults.

    Parameters
    ----------
    particles : Particles, optional
        Required without a start.
    dimension : {2, 3}, optional
        By default that of the shape's paper.
    seed : int, optional
        Random seed; 1 by default.
    protocol : str or int, optional
        One of `PROTOCOLS`, "quasistatic" by default; 1 and 2 are those of Yuan et al. 2019.
    **given
        Settings of `PROTOCOLS` by name, None for defaults; `strict`, whether to continue to a minimum without
        negative eigenvalues; `pressure`, `phi` and `box` of `Yielding`; and `stable_to_shear`.

    Returns
    -------
    Recipe

    Raises
    ------
    ValueError
        If a setting does not belong to the protocol, contradicts the start, or is out of its range.

    Examples
    --------
    >>> from jamshape.protocols.defaults import recipe_for
    >>> from jamshape.shapes.particles import Particles
    >>> recipe_for(Particles.of(alpha=4.0), protocol="marschall-2018").n
    1024
    """
    strict, stable = (bool(given.pop(name, None)) for name in ("strict", "stable_to_shear"))
    other = {name: given.pop(name, None) for name in ("pressure", "phi", "box")}
    other["box"] = other["box"] or (FREE if stable else None)
    source = None if given.get("start") is None else Source.read(Path(given["start"]))
    if source is not None:
        source.require(particles, n=given.get("n"), dimension=dimension, seed=seed)
        particles, dimension, seed = source.particles, source.dimension, source.seed
    particles, dimension = of = _placed(particles, dimension)
    name = "quasistatic" if protocol is None else protocol_named(protocol)
    require_one_of("protocol", name, PROTOCOLS)
    usual = PROTOCOLS[name]
    get = usual.defaults(dimension) | {"power": particles.power}
    get |= {"u0": _of_law(get, get["u0"])} | _allowed(given, usual, name, particles.power)
    aim = aim_of(get, given, **other)
    if aim is not None:
        get |= {"u0": aim.u0 or _of_law(get, _IN_BETWEEN), "accuracy": aim.accuracy}
    require_with("u0", get["u0"] or None, accuracy=given.get("accuracy"))
    get |= _of_source(source, given) if source else _at_random(get, given, seed, of)
    how, target = usual.compose(get)
    numbers = (get["n"], dimension, get["seed"], get["phi_start"])
    return Recipe(particles, *numbers, how, aim or target, strict=strict, stable_to_shear=stable)


def aim_of(
    get: Values,
    given: Values,
    *,
    pressure: float | None,
    phi: float | None,
    box: str | None,
) -> Yielding | None:
    """Return the target of a box that yields; None for an energy in an isotropic box, or none at all.

    Parameters
    ----------
    get
        u0, tolerance and the power of the law.
    given
        Those that were typed, and the accuracy.
    pressure, phi, box
        As typed; see `Yielding`.

    Raises
    ------
    ValueError
        If settings contradict each other or are out of their ranges.
    """
    if pressure is not None:
        require_in("pressure", pressure, Interaction(power=get["power"]).range_of("pressure"))
    if phi is not None:
        require_stated(phi=phi)
    require_no_effect("pressure", pressure, u0=given.get("u0"), phi=phi)
    require_no_effect("phi", phi, u0=given.get("u0"))
    if box == FIXED:
        said = "{box} keeps the packing fraction of the start, expected isotropic, free or components such as 'xx yy xy'"
        raise ArgumentError(said, {"box": box})
    if pressure is None and phi is None and box in {None, ISOTROPIC}:
        return None
    u0 = get["u0"] or None if pressure is None and phi is None else None
    if (pressure, phi, u0) == (None, None, None):
        said = "{box} needs a target, expected {pressure:name}, {u0:name} or {phi:name} as well"
        raise ArgumentError(said, {"box": box, "pressure": None, "u0": None, "phi": None})
    accuracy = 1e-8 if given.get("accuracy") is None else given["accuracy"]
    return Yielding(box or ISOTROPIC, pressure, u0, phi, accuracy, get["tolerance"])


def _placed(particles: Particles | None, dimension: int | None) -> tuple[Particles, int]:
    """Require particles, and return them with their dimension."""
    if particles is None:
        msg = "neither particles nor a start are given, expected one of them"
        raise ValueError(msg)
    dimension = particles.shape.dimension if dimension is None else dimension
    require_one_of("dimension", dimension, (2, 3))
    return particles, dimension


def _allowed(
    given: dict[str, Any], usual: UsualProtocol, protocol: str, power: float
) -> dict[str, Any]:
    """Drop settings that are None, and refuse invalid ones."""
    known = dict.fromkeys(name for protocol in PROTOCOLS.values() for name in protocol.usual)
    for name, value in given.items():
        if name not in known:
            msg = f"{name} is not a setting of a recipe, expected one of {', '.join(known)}"
            raise ValueError(msg)
        if value is not None and name not in usual.usual:
            said = f"{{{name}:name}} does not apply to the protocol {protocol}, expected another protocol or setting"
            raise ArgumentError(said, {name: value})
    kept = {name: value for name, value in given.items() if value is not None}
    if "u0" in kept:
        require_in("u0", kept["u0"], Interaction(power=power).range_of("u0"))
    require_stated(**{name: kept[name] for name in kept if name in RANGES and name != "u0"})
    return kept


def _at_random(
    get: Values, given: dict[str, Any], seed: int | None, of: tuple[Particles, int]
) -> dict[str, Any]:
    """Return a seed, and a packing fraction at which particles of this dimension have room if none was typed."""
    seed = 1 if seed is None else seed
    if given.get("phi_start") is not None:
        return {"seed": seed}
    return {"seed": seed, "phi_start": usual_phi_start(get["phi_start"], get["n"], seed, *of)}


def _of_source(source: Source, given: dict[str, Any]) -> dict[str, Any]:
    """Take settings from a start, and refuse those that would have no effect beside it."""
    for name in ("phi_start", "phi_end", "kappa"):
        if given.get(name) is not None:
            said = f"{{{name}}} has no effect on a start that is already compressed; leave it out"
            raise ArgumentError(said, {name: given[name]})
    own = {name: getattr(source, name) for name in ("n", "seed", "phi_start", "phi_end", "kappa")}
    return own | {"start": source.path}
