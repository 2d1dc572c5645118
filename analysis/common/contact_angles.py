"""Contact angles P(phi) of spherocylinders in the plane, and their figure (Marschall & Teitel 2018, Fig. 10)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.averages import mean, standard_error
from common.axes import figure_of
from common.styles import COLORS, color
from common.text import counted
from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import ContactNetwork
from jamshape.files.ensembles import PackingFile
from jamshape.measures.averages import Mean
from jamshape.measures.contact_statistics import cross, held_contacts, lever_arms, require_plane
from jamshape.packing import Packing
from jamshape.shapes.table import DEFAULT, shape_named

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUARTER = np.pi / 2  # contact angles are folded to [0, QUARTER]

# A bin with more than this multiple of the mean number of angles is split in two.
_CROWDED = 1.5


class AngleDensity(NamedTuple):
    """Probability density of the contact angle, a step function on [0, pi]."""

    edges: FloatArray
    """(B + 1,) limits of the bins, rad, ascending from 0 to pi and symmetric about pi / 2."""
    density: FloatArray
    """(B,) in 1 / rad; the integral from 0 to pi is 1."""


def contact_angles(packing: Packing, network: ContactNetwork, rattlers: BoolArray) -> FloatArray:
    """Polar angles of the contacts from the spine, about the centres of both particles.

    Marschall & Teitel 2018, Fig. 10. A side-to-side contact counts once, midway between its two bonds.
    By the symmetry of a particle the angles phi, -phi, pi - phi and pi + phi
    are equivalent.

    Parameters
    ----------
    packing : Packing
    network : ContactNetwork
        Its contacts, in two dimensions.
    rattlers : (N,) array of bool

    Returns
    -------
    (2 M',) array of float64
        Radians in [0, pi / 2], two for each of the M' held contacts: 0 at a tip, pi / 2 in the
        middle of a flat side.

    Raises
    ------
    ValueError
        If no contact is held, or in three dimensions.
    """
    require_plane(network)
    held, bonds = held_contacts(network, rattlers), network.bonds
    arms = np.zeros((2, *network.separation.shape))
    for arm, of_bond in zip(arms, lever_arms(packing, network), strict=True):
        np.add.at(arm, bonds.contact, of_bond / network.n_bonds[bonds.contact, None])
    arm, axis = arms[:, held], packing.axes[network.pairs[held].T]
    angles: FloatArray = np.arctan2(np.abs(cross(axis, arm)), np.abs((axis * arm).sum(axis=-1)))
    return angles.ravel()


def angle_edges(angles: FloatArray, coarse: int = 30, cuts: int = 6) -> FloatArray:
    """Bin edges that are wide where the density is smooth and narrow in its peaks.

    Equal bins are halved repeatedly as long as they hold more than 1.5 times the number
    expected for a uniform density.

    Parameters
    ----------
    angles : (K,) array of float64, rad
        Folded angles from `contact_angles`, of all packings together.
    coarse : int
        Initial number of bins.
    cuts : int
        Largest number of halvings of a bin; the default resolves 0.05 degrees.

    Returns
    -------
    (B + 1,) array of float64
        Ascending from 0 to pi / 2.

    Raises
    ------
    ValueError
        If there are no angles.
    """
    if not len(angles):
        msg = "there are no contact angles, expected at least one"
        raise ValueError(msg)
    crowd = _CROWDED * len(angles) / coarse
    edges = np.linspace(0, QUARTER, coarse + 1)
    for _ in range(cuts):
        counts, _ = np.histogram(angles, edges)
        middles = (edges[:-1] + edges[1:]) / 2
        edges = np.sort(np.concatenate([edges, middles[counts > crowd]]))
    return edges


def angle_density(angles: FloatArray, edges: FloatArray) -> AngleDensity:
    """Estimate the probability density of the contact angle on [0, pi], by symmetry.

    Marschall & Teitel 2018, Fig. 10, P(phi); 1 / pi for discs.

    Parameters
    ----------
    angles : (K,) array of float64, rad
        Folded angles from `contact_angles`.
    edges : (B + 1,) array of float64, rad
        Ascending from 0 to pi / 2, such as from `angle_edges`.

    Returns
    -------
    AngleDensity
        With 2 B bins.

    Raises
    ------
    ValueError
        If there are no angles, or one is beyond the edges.
    """
    counts, _ = np.histogram(angles, edges)
    if counts.sum() != len(angles) or not len(angles):
        msg = f"{counts.sum()} of {len(angles)} angles are within the edges, expected all, and at least one"
        raise ValueError(msg)
    half = counts / (2 * len(angles) * np.diff(edges))
    mirrored = np.pi - edges[-2::-1]
    return AngleDensity(np.concatenate([edges, mirrored]), np.concatenate([half, half[::-1]]))


def angles_of(file: PackingFile) -> FloatArray:
    """(K,) polar angles of the contacts of one packing, folded to [0, pi/2]; see `contact_angles`."""
    found = file.contacts()
    return contact_angles(found.packing, found.network, found.rattlers)


class AngleCurve(NamedTuple):
    """P(phi) of a system, averaged over samples."""

    edges: FloatArray
    """(B + 1,) degrees."""
    density: FloatArray
    """(B,) 1 / rad."""
    error: FloatArray
    """(B,), 0 for one sample."""
    samples: int
    n_contacts: int
    on_flat: Mean
    """Fraction of the angles on the flat sides."""

    @property
    def peak_degrees(self) -> float:
        """Centre of the bin with the highest P."""
        middles = (self.edges[1:] + self.edges[:-1]) / 2
        return float(middles[np.argmax(self.density)])


def angle_curve(alpha: float, files: Sequence[PackingFile]) -> AngleCurve:
    """Average P over samples in common bins; `alpha` determines where flat sides begin."""
    return curve_of_angles(alpha, [angles_of(file) for file in files])


def curve_of_angles(alpha: float, found: Sequence[FloatArray]) -> AngleCurve:
    """Average P over the angles (K,) of packings, or of frames of a run, in common bins."""
    edges = angle_edges(np.concatenate(found))
    densities = np.array([angle_density(angles, edges).density for angles in found])
    corner = np.arctan2(1, alpha)
    return AngleCurve(
        np.degrees(angle_density(found[0], edges).edges),
        densities.mean(axis=0),
        standard_error(densities),
        len(found),
        sum(map(len, found)) // 2,
        mean([np.count_nonzero(angles > corner) / len(angles) for angles in found]),
    )


def contact_angle_figure(curves: Mapping[str, AngleCurve], title: str) -> Figure:
    """Draw P(phi) of each curve with its name, and a band of one standard error on both sides."""
    figure = figure_of(6, 4.3)
    axes = figure.subplots()
    for k, (name, found) in enumerate(curves.items()):
        _draw_curve(axes, found, color(k), f"{name} ({counted(found.samples, 'sample')})")
    if any(found.samples > 1 for found in curves.values()):
        axes.fill_between([], [], color="0.5", alpha=0.25, lw=0, label="standard error")
    axes.axhline(1 / np.pi, color="0.4", ls=":", lw=1, label=r"discs, $1/\pi$", zorder=0)
    seen = np.concatenate([found.density[found.density > 0] for found in curves.values()])
    axes.set_yscale("log")
    axes.set(xlim=(0, 180), ylim=(max(seen.min() / 1.6, 3e-3), 8 * seen.max()))
    axes.set_xticks(range(0, 181, 30))
    axes.set_xlabel(r"angle $\varphi$ from the spine  [degrees]")
    axes.set_ylabel(r"density of contacts $P(\varphi)$  [1/rad]")
    place: dict[str, Any] = {"alignment": "left", "loc": "upper left", "frameon": False}
    axes.legend(fontsize=8, **place)
    axes.set_title(title, fontsize=8)
    _draw_particle(axes.inset_axes((0.72, 0.72, 0.26, 0.26)))
    return figure


def _draw_curve(axes: Axes, found: AngleCurve, tint: str, label: str) -> None:
    axes.stairs(found.density, found.edges, color=tint, lw=1.1, label=label, baseline=None)
    low, high = found.density - found.error, found.density + found.error
    band: dict[str, Any] = {"fill": True, "color": tint, "alpha": 0.25, "lw": 0}
    axes.stairs(high, found.edges, baseline=np.maximum(low, 1e-9), **band)


def _draw_particle(axes: Axes) -> None:
    """Illustrate the angle on a particle."""
    from matplotlib.patches import Arc, Polygon  # noqa: PLC0415 - not needed for --help

    body = shape_named(DEFAULT).outline(np.array([3.6, 2.0, 2.0]), np.empty(0))
    axes.add_patch(Polygon(body, facecolor="0.9", edgecolor="k", lw=0.8))
    axes.plot([-0.8, 1.8], [0, 0], "k", lw=0.8)
    axes.plot([0, 0.5], [0, 1], "k", lw=0.8)
    axes.plot(0.5, 1, "o", color=COLORS[1], ms=4)
    axes.add_patch(Arc((0, 0), 0.9, 0.9, theta1=0, theta2=np.degrees(np.arctan2(1, 0.5)), lw=0.8))
    axes.text(0.55, 0.25, r"$\varphi$", fontsize=9)
    axes.set(xlim=(-2, 2), ylim=(-1.15, 1.15), aspect="equal")
    axes.set_axis_off()
