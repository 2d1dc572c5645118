"""Pictures of packings, runs and modes, in figures and in notebooks."""

from __future__ import annotations

import base64
import html as markup
import io
from typing import TYPE_CHECKING, Any

from jamshape.arguments import ArgumentTypeError, checked
from jamshape.checks import ArgumentError, said
from jamshape.drawing.colors import color_of
from jamshape.drawing.ladder import Rungs, draw_rungs
from jamshape.drawing.modes import draw_density
from jamshape.drawing.packing import Look, add_legend, colorings, draw_packing
from jamshape.drawing.pictures import title_of
from jamshape.drawing.pressure import draw_pressure
from jamshape.drawing.shear import Cycles, draw_cycles, draw_steps, draw_stress
from jamshape.drawing.text import attribute_text, systems_text
from jamshape.files.ensembles import system_of
from jamshape.files.h5md import read_style
from jamshape.front.ensemble_file import EnsembleFile
from jamshape.front.modes import Modes
from jamshape.front.packing import public
from jamshape.front.run import (
    CyclicShearFile,
    LadderFile,
    QuasistaticShearFile,
    Recorded,
    RunFile,
    ShearFile,
)
from jamshape.measures.runs import read_run
from jamshape.measures.shears import read_shear
from jamshape.packing import Packing as PackingLike

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

_INCHES = {"packing": (5.0, 5.8), "curve": (5.0, 3.6)}
_DPI = 100


@checked
def plot(
    thing: PackingLike | Recorded | Modes, axes: Axes | None = None, *, color: str | None = None
) -> Axes:
    """Draw a packing, the pressure of a compression, the stress of a shear, phi_J of an ensemble, or the density of modes.

    Parameters
    ----------
    thing : Packing, RunFile, ShearFile, CyclicShearFile, QuasistaticShearFile, LadderFile, EnsembleFile or Modes
    axes : matplotlib Axes, optional
        Axes without a projection, for packings in space too; by default a new figure of
        `matplotlib.pyplot`.
    color : {"kind", "orientation", "one", "S2", "S4", "C4"}, optional
        Quantity that colours the particles of a packing: their kind (default), direction, or the nematic (S2), tetratic
        (S4) or cubatic (C4) order of their neighbours, also by these words.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    TypeError
        If it is none of these, or axes are not such axes.
    ValueError
        If the order is undefined in the packing's dimension, or a colour is given for anything but a packing.

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("agg")  # without a screen
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> axes = js.plot(packing)
    >>> "N=16" in axes.get_title()
    True
    """
    if color is not None and not isinstance(thing, PackingLike):
        msg = (
            f"{{color}} has no effect on a {type(thing).__name__}, expected a packing; leave it out"
        )
        raise ArgumentError(msg, {"color": color})
    color = color_of(color or "kind")
    if axes is None:
        import matplotlib.pyplot as plt  # noqa: PLC0415 - not needed where axes are given

        axes = plt.figure(figsize=_size(thing), layout="compressed").add_subplot()
    _require_plane(axes)
    _draw(thing, axes, color)
    return axes


def html(thing: PackingLike | Recorded | Modes) -> str:
    """Return HTML for notebooks: the repr and a picture."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only notebooks ask

    figure = Figure(figsize=_size(thing), layout="compressed")
    _draw(thing, figure.add_subplot(), "kind")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI, bbox_inches="tight")
    picture = base64.b64encode(stream.getvalue()).decode()
    image = f'<img alt="picture" src="data:image/png;base64,{picture}"/>'
    return f"<div><code>{markup.escape(repr(thing))}</code><br/>{image}</div>"


def _require_plane(axes: Any) -> None:
    from matplotlib.axes import Axes  # noqa: PLC0415 - slow

    if isinstance(axes, Axes) and axes.name == "rectilinear":
        return
    found = f"axes with projection={axes.name!r}" if isinstance(axes, Axes) else said(axes)
    msg = f"axes is {found}, expected matplotlib axes without a projection, as figure.add_subplot() makes them"
    raise ArgumentTypeError(msg)


def _size(thing: Any) -> tuple[float, float]:
    return _INCHES["packing" if isinstance(thing, PackingLike) else "curve"]


def _draw(thing: Any, axes: Axes, color: str) -> None:
    for kind, draw in _DRAWN.items():
        if isinstance(thing, kind):
            draw(thing, axes, color)
            return
    msg = f"a {type(thing).__name__} was given, expected a packing, a run or modes"
    raise TypeError(msg)


def _packing(packing: PackingLike, axes: Axes, color: str) -> None:
    found = public(packing).contacts()
    colored, scale = colorings([found], color)
    draw_packing(axes, found, colored[0], Look(color))
    axes.set_title(title_of(found, narrow=True), fontsize=9, linespacing=1.4)
    add_legend(axes, colored[0])
    if scale:
        figure: Any = axes.figure
        figure.colorbar(scale.mapped, ax=axes, shrink=0.8).set_label(scale.label)


def _run(run: RunFile, axes: Axes, color: str) -> None:
    del color
    draw_pressure(axes, read_run(run.file))


def _shear(run: ShearFile, axes: Axes, color: str) -> None:
    del color
    draw_stress(axes, read_shear(run.file))


def _cyclic(run: CyclicShearFile, axes: Axes, color: str) -> None:
    del color
    is_held = "hold_pressure" in run.about
    held = f" at {attribute_text('hold_pressure', run.about)}" if is_held else ""
    cycles = Cycles(run.strain, run.stress, int(run.about["rows"]), held)
    draw_cycles(axes, cycles, system_of(run.about, *read_style(run.file)))


def _quasistatic(run: QuasistaticShearFile, axes: Axes, color: str) -> None:
    del color
    who = system_of(run.about, *read_style(run.file))
    if run.steps_per_cycle:
        draw_cycles(axes, Cycles(run.strain, run.stress, run.steps_per_cycle), who)
        return
    draw_steps(axes, run.observables, who)


def _ensemble(table: EnsembleFile, axes: Axes, color: str) -> None:
    del color
    phi = table["phi_J"][table.reached]
    axes.hist(phi, bins=max(10, int(len(phi) ** 0.5)))
    axes.set(xlabel=r"$\phi_J$", ylabel="samples")
    told = ", ".join(attribute_text(name, table.about) for name in ("n", "u0"))
    who = systems_text([system_of(table.about, *read_style(table.file))])
    axes.set_title(f"{who}\n{told}, {len(phi)} of {len(table)} samples", fontsize=9)


def _ladder(run: LadderFile, axes: Axes, color: str) -> None:
    del color
    rungs = Rungs(run.values, run["z"], run.opened, run.closed)
    label = {"u0": "energy density $u$", "pressure": "pressure $p$"}[run.parameter]
    draw_rungs(axes, rungs, system_of(run.about, *read_style(run.file)), label)


def _modes(modes: Modes, axes: Axes, color: str) -> None:
    del color
    draw_density(axes, modes.told)
    known = modes.table.attributes
    axes.set_title(f"{len(modes)} modes, $N={known['n']}$, $z={known['z']:.3f}$", fontsize=9)


_DRAWN: dict[type, Callable[[Any, Axes, str], None]] = {
    PackingLike: _packing,
    EnsembleFile: _ensemble,
    RunFile: _run,
    ShearFile: _shear,
    CyclicShearFile: _cyclic,
    QuasistaticShearFile: _quasistatic,
    LadderFile: _ladder,
    Modes: _modes,
}
