"""How packings are usually made: what a recipe has where nothing else was asked for."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from jamshape.checks import RANGES, ArgumentError, require_one_of, require_stated, require_with
from jamshape.files.vocabulary import ATHERMAL, COMPRESSED, THERMAL, protocol_named
from jamshape.minima import METHODS
from jamshape.minima.target import Target
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
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

# A minimum that is led to an energy is at least so good.
_TIGHT = 1e-8

Values = Mapping[str, Any]
"""Numbers of a recipe by their names."""


class Setting(NamedTuple):
    """What may be asked for of a recipe; the ways and protocols that have it are those with a default."""

    name: str
    kind: Callable[[str], Any]
    """Reads it from the words of a command."""
    meaning: str


def minimiser_named(name: str) -> str:
    """Return the present name of a minimiser; warn of a former one."""
    if name != "paper":
        return name
    msg = "the minimiser 'paper' is called 'cg_marschall'; the former name will be refused"
    warnings.warn(msg, FutureWarning, stacklevel=2)
    return "cg_marschall"


SETTINGS = (
    Setting("n", int, "particles"),
    Setting("phi_start", float, "packing fraction of the random start"),
    Setting("tolerance", float, "largest net force and torque over the mean bond force"),
    Setting("u0", float, "energy density U/L^D; 0: the first jammed packing as it is"),
    Setting("accuracy", float, "of |u - u0|/u0"),
    Setting("kappa", float, "slowest compression rate"),
    Setting("p_end", float, "pressure to compress to at that rate"),
    Setting("phi_end", float, "packing fraction to compress to, beyond jamming"),
    Setting("phi_thermal", float, "packing fraction of the Monte Carlo"),
    Setting("n_sweeps", int, "sweeps of it"),
    Setting("delta_phi", float, "step of the packing fraction"),
    Setting("start", Path, "file of compress or slow, through jamming, instead of a compression"),
    Setting("search", str, "for u0; halving is the paper's"),
    Setting("minimiser", minimiser_named, "of the halving search; auto when left out"),
)

# Steps of the packing fraction grow to this far below jamming. What is led to an energy need not be balanced well before.
_COARSE, _ROUGH = 1e-2, 1e-2

# Of the square of the step, [energy]: a step adds some ten to a hundred times as much to a jammed packing.
_LOOSE = 2.5e-3

_LAMBDA = 1e-6  # of the halving search, to begin with (Marschall & Teitel 2018, Sec. III C)


class UsualWay(NamedTuple):
    """A way to jamming, or a protocol, by its name: how it is made of its settings, and their defaults.

    What has no default is no setting of it, and is refused.
    """

    compose: Callable[[Values], tuple[Way, Target | None]]
    """From the values of all its settings."""
    usual: Values
    in_plane: Values = MappingProxyType({})
    """Defaults that are others in 2D."""

    def defaults(self, dimension: int) -> dict[str, Any]:
        """Give all its settings as they are where nothing was asked for."""
        return dict(self.usual) | (dict(self.in_plane) if dimension == 2 else {})


def _by_dynamics(get: Values) -> tuple[Way, Target | None]:
    way = Dynamics(Approach(kappa=get["kappa"], p_end=get["p_end"]))
    return way, _target(get, get["tolerance"])


def _by_steps(get: Values) -> tuple[Way, Target | None]:
    quasistatic = Quasistatic(step=get["delta_phi"], tolerance=get["tolerance"])
    thermal = Thermalisation(get["phi_thermal"], get["n_sweeps"]) if "n_sweeps" in get else None
    return Steps(quasistatic, thermal), _target(get, min(get["tolerance"], _TIGHT))


def _by_adaptive_steps(get: Values) -> tuple[Way, Target | None]:
    step, tolerance = get["delta_phi"], get["tolerance"]
    coarse = max(_COARSE, step)
    rough = _ROUGH if get["u0"] else tolerance
    energy = {"energy": _LOOSE * step**2} if get["u0"] else {}
    quasistatic = Quasistatic(step=step, tolerance=rough, coarse=coarse, **energy)
    return Adaptive(quasistatic), _target(get, tolerance)


def _by_compression(get: Values) -> tuple[Way, Target | None]:
    way = Compressed(get["kappa"], get["phi_end"], get["search"], get["start"])
    target, minimiser = _target(get, get["tolerance"]), minimiser_named(get["minimiser"] or "auto")
    if way.search == "direct":
        if get["minimiser"] is not None:
            msg = (
                f"the minimiser is {minimiser} and the search direct, which has its own; expected a"
                " halving search, or no minimiser"
            )
            raise ValueError(msg)
        return way, target
    require_one_of("minimiser", minimiser, METHODS)
    return way, target and dataclasses.replace(target, step=_LAMBDA, method=minimiser)


def _target(get: Values, tolerance: float) -> Target | None:
    return Target(get["u0"], get["accuracy"], tolerance) if get["u0"] else None


_ATHERMAL = UsualWay(
    _by_steps,
    {"n": 400, "phi_start": 0.1, "tolerance": 1e-4, "u0": 0.0, "accuracy": 1e-7, "delta_phi": 1e-3},
    {"n": 256, "phi_start": 0.4},
)

WAYS: dict[str, UsualWay] = {
    "quasistatic": UsualWay(
        _by_adaptive_steps,
        {
            "n": 400, "phi_start": 0.1, "tolerance": 1e-8, "u0": 1e-12, "accuracy": 1e-7,
            "delta_phi": 2e-3,
        },
        {"n": 256, "phi_start": 0.4, "u0": 1e-15},
    ),
    "dynamics": UsualWay(
        _by_dynamics,
        {
            "n": 256, "phi_start": 0.4, "tolerance": 1e-8, "u0": 1e-15, "accuracy": 1e-7,
            "kappa": 4e-7, "p_end": 1e-3,
        },
    ),
    "steps": _ATHERMAL,
}  # fmt: skip
"""Quasistatic steps that adapt, the usual way; slow compression in LAMMPS; equal quasistatic steps."""

PROTOCOLS: dict[str, UsualWay] = {
    COMPRESSED: UsualWay(
        _by_compression,
        {
            "n": 1024, "phi_start": 0.1, "tolerance": 1e-8, "u0": 1e-15, "accuracy": 1e-7,
            "kappa": 1e-6, "phi_end": 0.8, "start": None, "search": "direct", "minimiser": None,
        },
        {"phi_start": 0.4, "phi_end": 0.95},
    ),
    ATHERMAL: _ATHERMAL,
    THERMAL: _ATHERMAL._replace(
        usual=dict(_ATHERMAL.usual) | {"phi_thermal": 0.55, "n_sweeps": 100_000}
    ),
}  # fmt: skip
"""As published, with the numbers of the papers where these say them.

marschall-2018: N = 1024 and phi_init = 0.4 (Marschall & Teitel 2018, Sec. III B), a fixed rate, of which they have
1e-6 to 1e-10; U_0/L^2 = 1e-15 to 1e-7 of itself (Sec. III C, Eq. 20). They do not say where a compression ends.
yuan-2019-1: N = 400, Delta phi = 1e-3, forces balanced to 1e-4, the first packing with U/N > 1e-10 (Yuan et al.
2019, Sec. 2.2); yuan-2019-2 with Monte Carlo at phi_i = 0.55, whose N_s they vary.
Both papers are of one dimension; in the other, N is that of the paper or as usual, and starts are as dense as one can place them.
"""


def recipe_for(
    particles: Particles | None = None,
    dimension: int | None = None,
    way: str | None = None,
    seed: int | None = None,
    protocol: int | str | None = None,
    **given: Any,
) -> Recipe:
    """Make a recipe of what is given, and of what is usual for the rest.

    Parameters
    ----------
    particles : Particles, optional
        Needed unless there is a start.
    dimension : {2, 3}, optional
        That of the shape's paper when left out.
    way : str, optional
        One of `WAYS`: quasistatic steps that adapt ("quasistatic"), usual, slow compression in LAMMPS
        ("dynamics"), or equal quasistatic steps ("steps").
    seed : int, optional
        Of all that is random; 1 when left out.
    protocol : str or int, optional
        One of `PROTOCOLS`, which is a way with the published numbers; 1 and 2 are those of Yuan et al. 2019.
    **given
        Of `SETTINGS` by name, None where they are left out; and `strict`, whether to go on to a minimum
        without negative eigenvalues.

    Returns
    -------
    Recipe

    Raises
    ------
    ValueError
        If a setting is none of the way or the protocol, contradicts the start, or is out of its range.

    Examples
    --------
    >>> from jamshape.protocols.defaults import recipe_for
    >>> from jamshape.shapes.particles import Particles
    >>> recipe_for(Particles.of(alpha=4.0), n=64).target.u0
    1e-15
    >>> recipe_for(Particles.of(alpha=4.0), protocol="marschall-2018").n
    1024
    """
    strict = bool(given.pop("strict", None))
    source = None if given.get("start") is None else Source.read(Path(given["start"]))
    if source is not None:
        source.require(particles, n=given.get("n"), dimension=dimension, seed=seed)
        particles, dimension, seed = source.particles, source.dimension, source.seed
    particles, dimension = _placed(particles, dimension)
    usual, called = _chosen(way, protocol)
    get = usual.defaults(dimension) | _allowed(given, usual, called)
    require_with("u0", get["u0"] or None, accuracy=given.get("accuracy"))
    if source is not None:
        get |= _of_source(source, given)
    how, target = usual.compose(get)
    numbers = (get["n"], dimension, 1 if seed is None else seed, get["phi_start"])
    return Recipe(particles, *numbers, how, target, strict=strict)


def _placed(particles: Particles | None, dimension: int | None) -> tuple[Particles, int]:
    """Require particles, and give the dimension that they are to be in."""
    if particles is None:
        msg = "there are neither particles nor a start, expected one of them"
        raise ValueError(msg)
    dimension = particles.shape.dimension if dimension is None else dimension
    require_one_of("dimension", dimension, (2, 3))
    return particles, dimension


def _chosen(way: str | None, protocol: int | str | None) -> tuple[UsualWay, str]:
    """Find the way or the protocol, and how sentences call it."""
    if protocol is None:
        way = way or "quasistatic"
        require_one_of("the way", way, WAYS)
        return WAYS[way], f"the way by {way}"
    name = protocol_named(protocol)
    require_one_of("protocol", name, PROTOCOLS)
    chosen = PROTOCOLS[name]
    if way is not None:
        require_one_of("the way", way, WAYS)
        if WAYS[way].compose is not chosen.compose:
            msg = f"the way is {way} and the protocol {name}, which has its own; leave the way out"
            raise ValueError(msg)
    return chosen, f"the protocol {name}"


def _allowed(given: dict[str, Any], usual: UsualWay, called: str) -> dict[str, Any]:
    """Leave out what was not given, and refuse what cannot be."""
    known = [setting.name for setting in SETTINGS]
    for name, value in given.items():
        if name not in known:
            msg = f"{name} is no setting of a recipe, expected one of {', '.join(known)}"
            raise ValueError(msg)
        if value is not None and name not in usual.usual:
            said = f"{{{name}:name}} is no setting of {called}, expected another way or setting"
            raise ArgumentError(said, {name: value})
    kept = {name: value for name, value in given.items() if value is not None}
    require_stated(**{name: value for name, value in kept.items() if name in RANGES})
    return kept


def _of_source(source: Source, given: dict[str, Any]) -> dict[str, Any]:
    """Take from a start what it is made of; what was asked for beside it would mean nothing."""
    for name in ("phi_start", "phi_end", "kappa"):
        if given.get(name) is not None:
            said = f"{{{name}}} means nothing to a start that is compressed already; leave it out"
            raise ArgumentError(said, {name: given[name]})
    own = {name: getattr(source, name) for name in ("n", "phi_start", "phi_end", "kappa")}
    return own | {"start": source.path}
