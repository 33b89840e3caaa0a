"""Inertias from motion and torques, by least squares over what bodies can be.

    minimise  |(W phi - y) / noise|^2 + weight |theta - theta_0|^2,   phi = phi(theta)

theta: log-Cholesky coordinates of every body, so that each estimate is that of a body, whatever the noise; friction
stands beside them as it is, and is at least 0. What the motion does not show stays near the model's, theta_0. W is
reduced to its triangle by QR first, so that the samples cost nothing in the search.
Source: Rucker and Wensing 2022, Smooth parameterization of rigid-body inertia.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr
from scipy.optimize import least_squares

from wbc import validation
from wbc.errors import InfeasibleError, RangeError
from wbc.identification.parameter_base import BaseParameters, base_parameters
from wbc.identification.pseudo_inertia import (
    from_log_cholesky,
    is_body,
    log_cholesky,
    model_parameters,
    nearest_body,
    parameters as of_pseudo,
    pseudo_inertia,
)
from wbc.identification.regression import Regression, Samples
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.two_velocities import PER_BODY
from wbc.validation import Array

#: Weight of the prior: a change of e-fold in one coordinate costs as much as a residual of so many deviations
PRIOR = 1e-2
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
        deviation = np.maximum(_by_dof(y - W @ free, nv), 1e-9)
    else:
        deviation = np.broadcast_to(validation.ordinary_array("noise", noise), (nv,))
        if not (deviation > 0.0).all():
            raise RangeError("noise", noise, "expected deviations above 0")
    weigh = np.tile(1.0 / deviation, count)
    triangle = qr(np.column_stack([W * weigh[:, None], y * weigh]), mode="r")[0][: W.shape[1] + 1]
    R, z = triangle[:, :-1], triangle[:, -1]
    moving = [k for k in range(bodies) if start[PER_BODY * k : PER_BODY * (k + 1)].any()]
    thetas = np.concatenate([log_cholesky(_solid(start[PER_BODY * k : PER_BODY * (k + 1)])) for k in moving])
    rest = W.shape[1] - PER_BODY * bodies
    first = np.concatenate([thetas, np.zeros(rest)])

    def phi_of(x: Array) -> tuple[Array, Array]:
        phi, slope = np.zeros(W.shape[1]), np.zeros((W.shape[1], len(x)))
        for i, k in enumerate(moving):
            own, here = slice(PER_BODY * k, PER_BODY * (k + 1)), slice(PER_BODY * i, PER_BODY * (i + 1))
            phi[own], slope[own, here] = from_log_cholesky(x[here])
        if rest:
            phi[-rest:], slope[-rest:, -rest:] = x[-rest:], np.eye(rest)
        return phi, slope

    prior = PRIOR * np.concatenate([np.ones(len(thetas)), np.zeros(rest)])

    def residuals(x: Array) -> Array:
        return np.concatenate([R @ phi_of(x)[0] - z, prior * (x - first)])

    def jacobian(x: Array) -> Array:
        return np.vstack([R @ phi_of(x)[1], np.diag(prior)])

    low = np.concatenate([np.full(len(thetas), -np.inf), np.zeros(rest)])
    inside = np.maximum(first, low + 1e-9 * (np.arange(len(first)) >= len(thetas)))
    found = least_squares(residuals, inside, jacobian, bounds=(low, np.inf), x_scale="jac", max_nfev=500)
    phi = phi_of(found.x)[0]
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
    return of_pseudo(nearest_body(P, np.diag([size, size, size, max(phi[0], THICK)]), 1.0))
