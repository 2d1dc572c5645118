"""Statistics of the contacts of packings: classes, positions on the surface, forces and torques.

For spherocylinders in two dimensions; Marschall & Teitel 2018, Sec. III C and Appendix A. Contacts of
rattlers are left out; the caller decides which particles are rattlers
(`jamshape.contacts.find_rattlers`, or the file of a packing).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import ContactKind, ContactNetwork
from jamshape.packing import Packing

QUARTER = np.pi / 2  # contact angles are folded to [0, QUARTER]

# A bin with more than this multiple of the mean number of angles is split in two.
_CROWDED = 1.5

_EXPONENTS = (0.05, 5.0)  # range of x searched for a + b alpha^x
_AT_END = 1e-3  # distance from its ends within which a fit has failed


class ClassFractions(NamedTuple):
    """Fractions of the bonds that belong to each class of contact; their sum is 1."""

    tip_to_tip: float
    tip_to_side: float
    side_to_side: float


class FlatFraction(NamedTuple):
    """Fraction of the particles that have a contact on at least one of their two flat sides."""

    of_backbone: float
    """Fraction of the particles without rattlers."""
    of_all: float
    """Fraction of all particles; rattlers have none."""


class AngleDensity(NamedTuple):
    """Probability density of the contact angle, a step function on [0, pi]."""

    edges: FloatArray
    """(B + 1,) limits of the bins, rad, ascending from 0 to pi and symmetric about pi / 2."""
    density: FloatArray
    """(B,) in 1 / rad; the integral from 0 to pi is 1."""


class ContactScale(NamedTuple):
    """Averages over the bonds, as units of net forces and torques."""

    force: float
    """[energy / length]"""
    torque: float
    """[energy], over both ends of each bond; 0 for discs."""


class Residuals(NamedTuple):
    """Net force and torque on each particle, over the `ContactScale`."""

    force: FloatArray
    """(N,); NaN for rattlers."""
    torque: FloatArray
    """(N,); NaN for rattlers, and for all if the mean contact torque is 0, as for discs."""


class OffsetPowerLaw(NamedTuple):
    """The curve a + b alpha^x, with standard errors; NaN where they cannot be estimated."""

    a: float
    b: float
    x: float
    a_error: float
    b_error: float
    x_error: float

    def at(self, alpha: ArrayLike) -> FloatArray:
        """Evaluate the curve."""
        curve: FloatArray = self.a + self.b * np.asarray(alpha, np.float64) ** self.x
        return curve


def held_contacts(network: ContactNetwork, rattlers: BoolArray) -> BoolArray:
    """Flag the contacts that do not involve rattlers.

    Parameters
    ----------
    network : ContactNetwork
    rattlers : (N,) array of bool

    Returns
    -------
    (M,) array of bool

    Raises
    ------
    ValueError
        If there is none.
    """
    held: BoolArray = ~np.logical_or(*rattlers[network.pairs.T])
    if not held.any():
        found = f"all {len(held)} contacts involve rattlers"
        msg = f"{found}, expected a jammed packing"
        raise ValueError(msg)
    return held


def class_fractions(network: ContactNetwork, rattlers: BoolArray) -> ClassFractions:
    """Fractions of bonds by class of contact; a side-to-side contact is two bonds.

    Marschall & Teitel 2018, Fig. 9. Counted as in `jamshape.contacts.coordination`: two bonds even
    if `find_contacts` was called with sides=1.

    Parameters
    ----------
    network : ContactNetwork
        Contacts of a packing in two dimensions.
    rattlers : (N,) array of bool

    Returns
    -------
    ClassFractions

    Raises
    ------
    ValueError
        If no contact is held, or in three dimensions.
    """
    _require_plane(network)
    kind = network.kind[held_contacts(network, rattlers)]
    contacts = np.bincount(kind, minlength=len(ContactKind))
    bonds = contacts * np.where(np.arange(len(ContactKind)) == ContactKind.SIDE_TO_SIDE, 2, 1)
    return ClassFractions(*(bonds / bonds.sum()).tolist())


def flat_contacts(network: ContactNetwork, rattlers: BoolArray) -> BoolArray:
    """Flag the particles that have a contact on one of their two flat sides.

    Parameters
    ----------
    network : ContactNetwork
    rattlers : (N,) array of bool

    Returns
    -------
    (N,) array of bool

    Raises
    ------
    ValueError
        If no contact is held.
    """
    held, bonds = held_contacts(network, rattlers), network.bonds
    on_side = np.repeat((network.kind == ContactKind.SIDE_TO_SIDE)[:, None], 2, axis=1)
    np.logical_or.at(on_side, bonds.contact, bonds.on_side)
    flat = np.zeros(len(rattlers), dtype=np.bool_)
    flat[network.pairs[held][on_side[held]]] = True
    return flat


def flat_fraction(network: ContactNetwork, rattlers: BoolArray) -> FlatFraction:
    """Count the particles of `flat_contacts`; arguments and errors as there.

    Marschall & Teitel 2018, Sec. III C: "virtually all the particles (96.3% of them) have a contact
    on at least one of their two flat sides" at alpha = 0.01, where 3.3 % are rattlers; the reference number
    is not given.
    """
    n_flat = np.count_nonzero(flat_contacts(network, rattlers))
    return FlatFraction(float(n_flat / np.count_nonzero(~rattlers)), float(n_flat / len(rattlers)))


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
    _require_plane(network)
    held, bonds = held_contacts(network, rattlers), network.bonds
    arms = np.zeros((2, *network.separation.shape))
    for arm, of_bond in zip(arms, _arms(packing, network), strict=True):
        np.add.at(arm, bonds.contact, of_bond / network.n_bonds[bonds.contact, None])
    arm, axis = arms[:, held], packing.axes[network.pairs[held].T]
    angles: FloatArray = np.arctan2(np.abs(_cross(axis, arm)), np.abs((axis * arm).sum(axis=-1)))
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


def contact_scale(packing: Packing, network: ContactNetwork, rattlers: BoolArray) -> ContactScale:
    """Mean bond force and mean contact torque.

    Marschall & Teitel 2018, Eqs. 36 and 37; a side-to-side contact is two bonds if it is in the
    network, as in their z.

    Parameters
    ----------
    packing : Packing
    network : ContactNetwork
        Its contacts, in two dimensions.
    rattlers : (N,) array of bool

    Returns
    -------
    ContactScale

    Raises
    ------
    ValueError
        If no contact is held, or in three dimensions.
    """
    _require_plane(network)
    bonds = network.bonds
    held = held_contacts(network, rattlers)[bonds.contact]
    force = bonds.force[held]
    torques = np.array([np.abs(_cross(arm[held], force)) for arm in _arms(packing, network)])
    # The lever arm of a disc is parallel to the force up to rounding.
    torques[packing.half_length[network.pairs[bonds.contact[held]]].T == 0] = 0
    return ContactScale(float(np.linalg.norm(force, axis=1).mean()), float(torques.mean()))


def residuals(
    net_force: ArrayLike, net_torque: ArrayLike, scale: ContactScale, rattlers: BoolArray
) -> Residuals:
    """Net forces and torques over the mean bond force and the mean contact torque.

    Marschall & Teitel 2018, Appendix A and Fig. 21.

    Parameters
    ----------
    net_force : (N, 2) array_like, [energy / length]
    net_torque : (N,) array_like, [energy]
    scale : ContactScale
    rattlers : (N,) array of bool

    Returns
    -------
    Residuals

    Raises
    ------
    ValueError
        If shapes disagree.
    """
    force, torque = np.asarray(net_force, np.float64), np.asarray(net_torque, np.float64)
    n = len(rattlers)
    if force.shape != (n, 2) or torque.shape != (n,):
        found = f"net force and torque have shapes {force.shape} and {torque.shape}"
        msg = f"{found}, expected ({n}, 2) and ({n},)"
        raise ValueError(msg)
    unknown = np.full(n, np.nan)
    return Residuals(
        np.where(rattlers, np.nan, np.linalg.norm(force, axis=1) / scale.force),
        np.where(rattlers, np.nan, np.abs(torque) / scale.torque) if scale.torque else unknown,
    )


def fit_offset_power_law(
    alpha: ArrayLike, values: ArrayLike, errors: ArrayLike | None = None
) -> OffsetPowerLaw:
    """Fit a + b alpha^x by least squares.

    Marschall & Teitel 2018, Fig. 8(b): the contact number above 4 at the four smallest alpha.

    Parameters
    ----------
    alpha, values : (K,) array_like
        At least three different alpha above 0.
    errors : (K,) array_like, optional
        Standard errors of the values, above 0. Without them all values have equal weight, and the
        scatter about the curve gives the errors, if there are more than three values.

    Returns
    -------
    OffsetPowerLaw

    Raises
    ------
    ValueError
        If there are fewer than three alpha, a number is out of its range, or the best exponent is not between
        0.05 and 5.
    """
    x, y = np.asarray(alpha, np.float64), np.asarray(values, np.float64)
    sigma = np.ones_like(y) if errors is None else np.asarray(errors, np.float64)
    if x.ndim != 1 or not x.shape == y.shape == sigma.shape or len(np.unique(x)) < 3:
        found = f"alpha, values and errors have shapes {x.shape}, {y.shape} and {sigma.shape}"
        msg = f"{found} and {len(np.unique(x))} different alpha, expected (K,) with at least 3"
        raise ValueError(msg)
    if not ((x > 0).all() and (sigma > 0).all() and np.isfinite([x, y, sigma]).all()):
        msg = "alpha, values or errors hold a number out of range, expected alpha and errors > 0"
        raise ValueError(msg)

    def line(exponent: float) -> tuple[FloatArray, float]:
        powers = np.column_stack([np.ones_like(x), x**exponent]) / sigma[:, None]
        solution = np.linalg.lstsq(powers, y / sigma, rcond=None)[0].astype(np.float64)
        return solution, float(((powers @ solution - y / sigma) ** 2).sum())

    tried = np.geomspace(*_EXPONENTS, 200)
    best = tried[np.argmin([line(exponent)[1] for exponent in tried])]
    near = (best * tried[0] / tried[1], best * tried[1] / tried[0])
    exponent = float(minimize_scalar(lambda e: line(e)[1], bounds=near, method="bounded").x)
    if not _EXPONENTS[0] * (1 + _AT_END) < exponent < _EXPONENTS[1] * (1 - _AT_END):
        found = "no exponent of alpha between {:g} and {:g} fits best".format(*_EXPONENTS)
        msg = f"{found}, expected values with a limit as alpha goes to 0 and with small errors"
        raise ValueError(msg)
    (a, b), chi_squared = line(exponent)
    power = x**exponent
    slopes = np.column_stack([np.ones_like(x), power, b * power * np.log(x)]) / sigma[:, None]
    covariance = np.linalg.pinv(slopes.T @ slopes)
    if errors is None:
        covariance *= chi_squared / (len(x) - 3) if len(x) > 3 else np.nan
    return OffsetPowerLaw(float(a), float(b), exponent, *np.sqrt(np.diag(covariance)).tolist())


def _require_plane(network: ContactNetwork) -> None:
    dimension = network.separation.shape[1]
    if dimension != 2:
        msg = f"the contacts are in {dimension} dimensions, expected 2"
        raise ValueError(msg)


def _arms(packing: Packing, network: ContactNetwork) -> tuple[FloatArray, FloatArray]:
    """(B, 2) from the centres of i and of j to the points of the bonds."""
    contact = network.bonds.contact
    arm_i = network.bonds.point - packing.position[network.pairs[contact, 0]]
    return arm_i, arm_i + network.separation[contact]


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    product: FloatArray = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return product
