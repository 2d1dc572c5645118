"""Shear at any rate, however slow, by implicit steps; needs no LAMMPS."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jamshape.checks import RANGES, require_in, require_one_of, require_positive
from jamshape.contacts import Contacts
from jamshape.flow.box_control import BoxControl
from jamshape.flow.host import Host
from jamshape.flow.implicit import METHODS, Flow, Leg
from jamshape.flow.shear import FLOWS
from jamshape.landscape import Landscape
from jamshape.measures.order import nematic_of
from jamshape.measures.stress import ShearStress


@dataclass(frozen=True)
class SlowShear:
    """Settings of a shear by implicit steps.

    Parameters
    ----------
    gdot, strain_end, flow, hold_pressure, t_box
        See `jamshape.flow.shear.Shear`.
    tolerance, k_d, largest_strain, largest_drop, method
        See `jamshape.flow.implicit.Protocol`.

    Raises
    ------
    ValueError
        If a number is out of its range, or the flow or method is unknown.
    """

    gdot: float = 1e-7
    strain_end: float = 1.0
    flow: str = "simple"
    tolerance: float = 1e-3
    k_d: float = 1.0
    largest_strain: float = 1e-3
    largest_drop: float = math.inf
    method: str = "tr-bdf2"
    hold_pressure: float | None = None
    t_box: float | None = None

    def __post_init__(self) -> None:
        names = ("gdot", "strain_end", "tolerance", "k_d", "largest_strain")
        require_positive(**{name: getattr(self, name) for name in names})
        if self.largest_drop != math.inf:
            require_positive(largest_drop=self.largest_drop)
        require_one_of("flow", self.flow, FLOWS)
        require_one_of("the method", self.method, METHODS)
        if self.flow == "pure":
            require_in("strain", self.strain_end, RANGES["pure_strain"])
        _ = self.control  # refuses what it does not go with

    @property
    def control(self) -> BoxControl | None:
        """Normal pressure to which the height of the box yields, if any."""
        return BoxControl.of_shear(self.hold_pressure, self.t_box, self.flow)

    def leg(self, flow: Flow, phi: float) -> Leg:
        """Return the host, and for how long it applies."""
        del phi
        host = Host.shearing(self.gdot, self.flow, flow.state.dimension)
        return Leg(host, (self.strain_end - flow.strain) / self.gdot)

    def is_over(self, flow: Flow, phi: float) -> bool:
        """Whether the end is reached."""
        del phi
        return flow.strain >= self.strain_end * (1 - 1e-12)

    def measured(self, landscape: Landscape, flow: Flow) -> dict[str, float]:
        """Return stress, a held pressure, contacts, order and rotation, named as those of `jamshape.flow.shear`."""
        state = flow.state
        packing = state.packing(landscape.particles)
        tensor = landscape.stress(state)
        order = nematic_of(packing)
        found = ShearStress.of(tensor)._asdict() | {
            f"{'shear' if self.flow == 'simple' else 'pure'}_strain": flow.strain,
            "z": Contacts.of(packing, landscape.k_e, landscape.sides).z,
            "S_2": order.S_n,
            "director": order.theta_n,
            "turned": flow.turned if landscape.rotation_length.any() else 0.0,
        }
        return found | {"p_yy": float(tensor[1, 1])} if self.control else found

    def where(self, phi: float) -> str:
        """Describe the position, for messages."""
        held = f" and the pressure {self.hold_pressure:g}" if self.control else ""
        return f"at phi = {phi:.6g} at the rate gdot = {self.gdot:g}{held}"
