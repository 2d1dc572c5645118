"""Stress of a sheared packing against strain, with its start-up and its steady state."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from jamshape.drawing.text import ensemble_text, pressure_unit, systems_text
from jamshape.measures.cycles import moduli_of
from jamshape.measures.events import stress_drops

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

    from jamshape.arrays import FloatArray
    from jamshape.files.ensembles import System
    from jamshape.measures.shears import ShearOf


def draw_stress(axes: Axes, run: ShearOf) -> None:
    """Draw pressure and shear stress of a run, and their means over the steady state."""
    steady, strain = run.steady, run.strain
    series = (
        ("pressure", "C0", run.observables["pressure"], "pressure $p$"),
        ("shear_stress", "C1", -run.observables["p_xy"], "shear stress $-p_{xy}$"),
    )
    for name, color, values, label in series:
        mean = f", steady ${steady[name].mean.tex}$" if steady else ""
        axes.plot(strain, values, color=color, lw=0.8, label=f"{label}{mean}")
        if steady:
            axes.plot(
                [steady.startup, steady.strain], [steady[name].value] * 2, "k", lw=1, zorder=3
            )
    if steady:
        axes.axvspan(0, steady.startup, color="0.85", lw=0, label="start-up, not averaged")
    unit = pressure_unit([run.ensemble.system])
    axes.set(xlabel=r"strain $\gamma$", ylabel=rf"stress  ${unit}$", xlim=(0, strain[-1]))
    axes.set_title(title_of(run), size=9)
    axes.legend(fontsize=8)


class Cycles(NamedTuple):
    """A cyclic shear."""

    strain: FloatArray
    stress: FloatArray
    rows: int
    """Number of rows of a cycle."""
    held: str = ""
    """Pressure that is held instead of the volume, for the title."""


def draw_cycles(axes: Axes, run: Cycles, system: System) -> None:
    """Draw the stress against the strain, with the first and the last whole cycle in color."""
    axes.plot(run.strain, run.stress, color="0.7", lw=0.5)
    last = max(1, (len(run.strain) - 1) // run.rows)
    for cycle, color in {1: "C0", last: "C1"}.items():
        part = slice((cycle - 1) * run.rows, cycle * run.rows + 1)
        axes.plot(run.strain[part], run.stress[part], color=color, lw=1, label=f"cycle {cycle}")
    axes.set(xlabel=r"strain $\gamma$", ylabel=rf"shear stress  ${pressure_unit([system])}$")
    axes.locator_params(axis="x", nbins=5)  # small strains have long numbers
    title = f"{systems_text([system])}, cyclic shear{run.held}"
    if len(run.strain) > run.rows:
        storage, loss = moduli_of(run.strain[part], run.stress[part])
        title += f"\ncycle {last}: $G'={storage:.3g}$, $G''={loss:.3g}$"
    axes.set_title(title, size=9)
    axes.legend(fontsize=8)


def draw_steps(axes: Axes, observables: Mapping[str, FloatArray], system: System) -> None:
    """Draw pressure and shear stress of a quasistatic shear, with a mark where each stress drop begins."""
    strain, stress = observables["strain"], observables["stress"]
    axes.plot(strain, observables["pressure"], color="C0", lw=0.8, label="pressure $p$")
    axes.plot(strain, stress, color="C1", lw=0.8, label=r"shear stress $\sigma$")
    events = stress_drops(observables)
    if events:
        places = [event.strain for event in events], [event.stress for event in events]
        axes.plot(*places, "k.", ms=4, label="stress begins to drop")
    unit = pressure_unit([system])
    axes.set(xlabel=r"strain $\gamma$", ylabel=rf"stress  ${unit}$", xlim=sorted((0, strain[-1])))
    axes.set_title(f"{systems_text([system])}, quasistatic shear", size=9)
    axes.legend(fontsize=8)


def title_of(run: ShearOf) -> str:
    """Describe the system and the shear."""
    held = "hold_pressure" if run.ensemble.hold_pressure else "phi"
    return f"{ensemble_text(run.ensemble, ('n', held, 'gdot'))}, {run.ensemble.flow} shear"
