"""Inertial parameters of a body that no body can be without: pseudo-inertia and its log-Cholesky coordinates.

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


def log_cholesky(phi: Array) -> Array:
    """Ten coordinates (alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3) in which every number is a body.

        P = U U',  U = e^alpha [e^d1 s12 s13 t1; 0 e^d2 s23 t2; 0 0 e^d3 t3; 0 0 0 1]

    Source: Rucker and Wensing 2022, Smooth parameterization of rigid-body inertia.

    Raises:
        ShapeError, NotFiniteError, RangeError: not the parameters of a body.
    """
    P = pseudo_inertia(checked_body("phi", phi))
    # An upper factor is a lower one of the matrix that is turned round
    U = np.linalg.cholesky(P[::-1, ::-1])[::-1, ::-1]
    scale = U[3, 3]
    U = U / scale
    return np.array([np.log(scale), *np.log(np.diag(U)[:3]), U[0, 1], U[1, 2], U[0, 2], *U[:3, 3]])


def from_log_cholesky(theta: Array) -> tuple[Array, Array]:
    """(phi ``[10]``, d phi / d theta ``[10, 10]``) of log-Cholesky coordinates."""
    U = _factor(theta)
    P = U @ U.T
    slopes = np.empty((16, 10))
    slopes[:, 0] = 2.0 * P.ravel()
    scale = U[3, 3]
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    for k, (i, j) in enumerate(places, start=1):
        change = np.zeros((4, 4))
        # d e^d = e^d on the diagonal
        change[i] = (U[i, j] if i == j else scale) * U[:, j]
        slopes[:, k] = (change + change.T).ravel()
    return parameters(P), np.asarray(FROM_PSEUDO @ slopes)


def _factor(theta: Array) -> Array:
    U = np.eye(4)
    U[[0, 1, 2], [0, 1, 2]] = np.exp(theta[1:4])
    U[0, 1], U[1, 2], U[0, 2] = theta[4:7]
    U[:3, 3] = theta[7:10]
    return np.asarray(np.exp(theta[0]) * U)


def nearest_body(P: Array, scale: Array, least: float = 0.0) -> Array:
    """The P that is nearest in the metric of ``scale`` = G G' and has no eigenvalue of G^-1 P G'^-1 below ``least``."""
    G = np.linalg.cholesky(scale)
    Z = np.linalg.solve(G, np.linalg.solve(G, P).T)
    values, vectors = np.linalg.eigh((Z + Z.T) / 2.0)
    if values[0] >= least:
        return P
    turned = G @ vectors
    return np.asarray((turned * np.maximum(values, least)) @ turned.T)
