"""Pressure and shear stress resolved by class of contact."""

from __future__ import annotations

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import Contacts


def class_stress(found: Contacts) -> dict[int, FloatArray]:
    """Return the pressure tensor of the contacts of each class.

    Parameters
    ----------
    found : Contacts
        Contacts of classes 0 tip-to-tip, 1 tip-to-side and 2 side-to-side; shapes without sides have only 0.

    Returns
    -------
    dict
        (D, D) arrays p_kl by class, the sum of r_l f_k over its contacts, over the volume, [energy / length^D].
        Their sum is the pressure tensor.
    """
    network, volume = found.network, found.packing.box.volume
    tensors = np.einsum("ck,cl->ckl", network.force, network.separation) / volume
    return {
        int(kind): tensors[network.kind == kind].sum(axis=0) for kind in np.unique(network.kind)
    }
