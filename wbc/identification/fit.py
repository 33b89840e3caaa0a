"""Inertias from motion and torques: the best of all that bodies can be.

    minimise  |(W phi - y) / noise|^2 / 2 + weight sum_k d(P_k, P_k0)

P_k: pseudo-inertia of body k, linear in its ten parameters, and d: its distance from the model's
(:mod:`wbc.identification.cones`), infinite where it belongs to no body. What the motion does not show stays near the
model's. Friction stands beside the bodies, a number above 0 with the same distance to little. W is reduced to its
triangle by QR first, so that the samples cost nothing in the search.
Source: Lee, Wensing and Park 2020, Geometric robot dynamic identification: a convex programming approach.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from wbc import validation
from wbc.errors import InfeasibleError, RangeError
from wbc.identification.cones import SemidefiniteCone, least_squares
from wbc.identification.parameter_base import BaseParameters, base_parameters
from wbc.identification.pseudo_inertia import (
    TO_PSEUDO,
    is_body,
    model_parameters,
    nearest_body,
    parameters,
    pseudo_inertia,
)
from wbc.identification.regression import Regression, Samples
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.two_velocities import PER_BODY
from wbc.validation import Array

#: Weight of the distance to the model, in squares of standard deviations
PRIOR = 1e-4
#: Torques are taken to be exact to this part of their root of the mean square at best
EXACT = 1e-8
#: Friction is thought to be this part of what would explain all torques
LITTLE = 1e-3
#: A body that is flat or a point gets this part of its own size, so that it has a density
THICK = 1e-6


@dataclass(frozen=True, eq=False)
class Identified:
    """What was found.

    Attributes:
        robot: with the identified masses and inertias. parameters: all columns of the regression.
        base: base parameters of the samples, value of each (``base.combination @ parameters``).
        deviations: of the base values, by the residuals, standard deviations.
        residual: root of the mean square of torques that are not explained, of each degree of freedom [N m or N].
        start: the same with the parameters of the model.
    """

    robot: Robot
    parameters: Array
    base: BaseParameters
    values: Array
    deviations: Array
    residual: Array
    start: Array

    def friction(self) -> tuple[Array, Array]:
        """(viscous, Coulomb) of each driven degree of freedom; empty where it was not identified."""
        rest = self.parameters[PER_BODY * len(self.robot.joint_names) :]
        viscous, coulomb = np.split(rest, 2)
        return viscous, coulomb


def identify(regression: Regression, samples: Samples, *, noise: Array | float | None = None) -> Identified:
    """Bodies (and friction) that explain torques.

    Args:
        regression: of the robot whose model is the first guess. samples: states and torques. noise: standard deviation
            of torques, one or one each [N m or N]; None: from a first fit.

    Raises:
        ShapeError, NotFiniteError: other shapes, or numbers that are none. RangeError: noise not above 0; the model has
            a body of negative mass or of impossible moments. InfeasibleError: the motion shows nothing.
    """
    robot, bodies = regression.robot, len(regression.robot.joint_names)
    W, y = regression.stacked(samples)
    count, nv = len(samples.q), robot.nv
    if not np.abs(W).max() > 0.0:
        raise InfeasibleError("samples", count, "the motion needs no torque whatever the bodies are")
    start = model_parameters(robot.model)
    guess = np.concatenate([start, np.zeros(W.shape[1] - len(start))])
    before = _by_dof(y - W @ guess, nv)
    if noise is None:
        free = np.linalg.lstsq(W, y, rcond=1e-10)[0]
        deviation = _by_dof(y - W @ free, nv)
    else:
        deviation = np.broadcast_to(validation.ordinary_array("noise", noise), (nv,))
        if not (deviation > 0.0).all():
            raise RangeError("noise", noise, "expected deviations above 0")
    least = max(EXACT * float(np.sqrt((y**2).mean())), np.finfo(float).tiny)
    weigh = np.tile(1.0 / np.maximum(deviation, least), count)
    triangle = qr(np.column_stack([W * weigh[:, None], y * weigh]), mode="r")[0][: W.shape[1] + 1]
    R, z = triangle[:, :-1], triangle[:, -1]
    moving = [k for k in range(bodies) if start[PER_BODY * k : PER_BODY * (k + 1)].any()]
    cones = []
    for k in moving:
        own = slice(PER_BODY * k, PER_BODY * (k + 1))
        cones.append(SemidefiniteCone(own, TO_PSEUDO, pseudo_inertia(_solid(start[own]))))
    for column in range(PER_BODY * bodies, W.shape[1]):
        if shown := float(np.linalg.norm(R[:, column])):
            little = LITTLE * float(np.linalg.norm(z)) / shown
            cones.append(SemidefiniteCone(slice(column, column + 1), np.eye(1), np.array([[little]])))
    phi = least_squares(R, z, cones, PRIOR)
    base = base_parameters(W)
    columns = list(base.columns)
    covariance = np.linalg.inv((W * weigh[:, None])[:, columns].T @ (W * weigh[:, None])[:, columns])
    model = robot.model.copy()
    for k in moving:
        model.inertias[k + 1] = pin.Inertia.FromDynamicParameters(phi[PER_BODY * k : PER_BODY * (k + 1)])
    return Identified(
        replace(robot, model=model),
        phi,
        base,
        base.combination @ phi,
        np.sqrt(np.diag(covariance)),
        _by_dof(y - W @ phi, nv),
        before,
    )


def _by_dof(residual: Array, nv: int) -> Array:
    return np.asarray(np.sqrt((residual.reshape(-1, nv) ** 2).mean(axis=0)))


def _solid(phi: Array) -> Array:
    """A body that has a density, if need be by a little of its own size in all directions."""
    if is_body(phi):
        return phi
    P = pseudo_inertia(phi)
    size = THICK * max(float(np.trace(P[:3, :3])), THICK * phi[0])
    return parameters(nearest_body(P, np.diag([size, size, size, max(phi[0], THICK)]), 1.0))
