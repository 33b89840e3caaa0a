"""Inertial parameters of a body that no body can be without: its pseudo-inertia.

    P = [Sigma  h; h'  m],   Sigma = int r r' dm,   I = tr(Sigma) 1 - Sigma

Mass, moments and the triangle inequalities of I belong to a body exactly where P > 0 (Wensing, Kim and Slotine 2018,
Linear matrix inequalities for physically consistent inertial parameter identification). Parameters phi are ten numbers
in the order of ``pin.Inertia.toDynamicParameters``: m, h, and I about the origin as xx, xy, yy, xz, yz, zz.
"""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.validation import Array

#: Places of the moments in phi: xx, xy, yy, xz, yz, zz
_MOMENTS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
#: A smallest eigenvalue of P below this part of the largest belongs to no body
_THIN = 1e-14


def _linear() -> Array:
    """[16, 10]: P column by column, as a linear function of phi."""
    out = np.zeros((16, 10))
    for k in range(10):
        P, phi = np.zeros((4, 4)), np.eye(10)[k]
        moments = np.zeros((3, 3))
        for (i, j), value in zip(_MOMENTS, phi[4:], strict=True):
            moments[i, j] = moments[j, i] = value
        P[:3, :3] = np.trace(moments) / 2.0 * np.eye(3) - moments
        P[:3, 3] = P[3, :3] = phi[1:4]
        P[3, 3] = phi[0]
        out[:, k] = P.ravel()
    return out


#: vec P = TO_PSEUDO phi
TO_PSEUDO: Array = _linear()
#: phi = FROM_PSEUDO vec P, for symmetric P
FROM_PSEUDO: Array = np.asarray(np.linalg.pinv(TO_PSEUDO), dtype=np.float64)


def pseudo_inertia(phi: Array) -> Array:
    """P ``[4, 4]`` of ten parameters."""
    return np.asarray((TO_PSEUDO @ phi).reshape(4, 4))


def parameters(P: Array) -> Array:
    """The ten parameters of a symmetric P."""
    return np.asarray(FROM_PSEUDO @ P.ravel())


def model_parameters(model: pin.Model) -> Array:
    """Ten parameters a joint of a ``pin.Model``, from the first joint on."""
    return np.concatenate([np.array(body.toDynamicParameters()) for body in model.inertias[1:]])


def is_body(phi: Array) -> bool:
    """Whether a body with a density has these parameters: P > 0."""
    values = np.linalg.eigvalsh(pseudo_inertia(phi))
    return bool(values[0] > _THIN * max(values[-1], 0.0))


def checked_body(field: str, phi: Array) -> Array:
    """Ten parameters of a body.

    Raises:
        ShapeError, NotFiniteError: no ten numbers. RangeError: a mass that is not above 0, or moments of no body.
    """
    phi = validation.ordinary_array(field, phi, (10,))
    if not phi[0] > 0.0:
        raise RangeError(f"{field}.mass", float(phi[0]), "expected a mass above 0 kg")
    if not is_body(phi):
        raise RangeError(field, phi, "no body has such moments: its pseudo-inertia is not positive definite")
    return phi


def nearest_body(P: Array, scale: Array, least: float = 0.0) -> Array:
    """The P that is nearest in the metric of ``scale`` = G G' and has no eigenvalue of G^-1 P G'^-1 below ``least``."""
    G = np.linalg.cholesky(scale)
    Z = np.linalg.solve(G, np.linalg.solve(G, P).T)
    values, vectors = np.linalg.eigh((Z + Z.T) / 2.0)
    if values[0] >= least:
        return P
    turned = G @ vectors
    return np.asarray((turned * np.maximum(values, least)) @ turned.T)
