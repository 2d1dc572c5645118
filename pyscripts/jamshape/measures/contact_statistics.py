"""Contacts of the backbone, and residual forces and torques over the mean contact.

For spherocylinders in two dimensions; Marschall & Teitel 2018, Sec. III C and Appendix A. Contacts of
rattlers are left out; the caller decides which particles are rattlers
(`jamshape.contacts.find_rattlers`, or the file of a packing).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import ContactNetwork
from jamshape.packing import Packing


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
    require_plane(network)
    bonds = network.bonds
    held = held_contacts(network, rattlers)[bonds.contact]
    force = bonds.force[held]
    torques = np.array([np.abs(cross(arm[held], force)) for arm in lever_arms(packing, network)])
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


def require_plane(network: ContactNetwork) -> None:
    """Refuse contacts that are not in two dimensions."""
    dimension = network.separation.shape[1]
    if dimension != 2:
        msg = f"the contacts are in {dimension} dimensions, expected 2"
        raise ValueError(msg)


def lever_arms(packing: Packing, network: ContactNetwork) -> tuple[FloatArray, FloatArray]:
    """(B, 2) from the centres of i and of j to the points of the bonds."""
    contact = network.bonds.contact
    arm_i = network.bonds.point - packing.position[network.pairs[contact, 0]]
    return arm_i, arm_i + network.separation[contact]


def cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the cross products of vectors in the plane."""
    product: FloatArray = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return product
