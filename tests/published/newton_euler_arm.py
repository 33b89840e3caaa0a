"""The three-link arm of the thesis on Newton and Euler's equations, for its tests: referee, runs, models of a step."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

from wbc.published.newton_euler import (
    Adaptive,
    DecoupledArm,
    DecoupledTwo,
    DriveTrain,
    Linearised,
    Link,
    Nominal,
    Rigid,
    SerialChain,
    SimulatedRun,
    discretised,
    linear_model,
    simulate,
)
from wbc.published.newton_euler.three_link import MOTOR, arm, task, tip
from wbc.validation import Array

ARM, TASK, DRIVE, DT = arm(), task(), DriveTrain([MOTOR] * 3), 0.01
#: As good as 20 to 2e-7 of the errors, but for a chattering joint
SUBSTEPS = 4
Q, R = 1e5 * np.eye(6), 0.01 * np.eye(3)
#: Weights on errors with 10^4 times more on positions
STIFF = np.diag([1e9] * 3 + [1e5] * 3)


@cache
def referee() -> pin.Model:
    """The arm written down by hand for Pinocchio; nothing of the package is in it."""
    model, first = pin.Model(), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    one = pin.SE3.Identity()
    j = model.addJoint(0, pin.JointModelRZ(), one, "j1")
    inertia = first @ np.diag([0.276, 0.255, 0.071]) @ first.T
    model.appendBodyToJoint(j, pin.Inertia(9.29, first @ [0, 0.0175, -0.1105], inertia), one)
    j = model.addJoint(j, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0, 0.1524, 0])), "j2")
    model.appendBodyToJoint(j, pin.Inertia(5.01, np.array([0, -0.1054, 0]), np.diag([0.108, 0.018, 0.1])), one)
    j = model.addJoint(j, pin.JointModelPZ(), one, "j3")
    model.appendBodyToJoint(j, pin.Inertia(4.25, np.array([0, 0, -0.6447]), np.diag([2.51, 2.51, 0.006])), one)
    model.gravity.linear = np.array([0, 0, -9.80621])
    return model


def random_arm(rng: np.random.Generator, n: int) -> SerialChain:
    """Any axes, any levers, turning and sliding joints."""
    links = []
    for _ in range(n):
        sides = rng.uniform(0.1, 1.0, 3) ** 2
        links.append(
            Link(
                rng.uniform(0.5, 5.0), sides.sum() - sides, rng.normal(size=3), rng.normal(size=3),
                0.5 * rng.normal(size=3), 0.5 * rng.normal(size=3), bool(rng.random() < 0.3),
            )
        )  # fmt: skip
    return SerialChain(tuple(links), rng.normal(size=3), rng.normal(size=3))


def controller(name: str) -> Nominal | Linearised | Adaptive | DecoupledArm | DecoupledTwo:
    if name == "nominal":
        return Nominal(ARM, TASK)
    if name == "linearised":
        return Linearised(ARM, TASK, DT)
    if name == "adaptive":
        return Adaptive(ARM, TASK, DT)
    if name == "decoupled two":
        return DecoupledTwo(TASK, DT)
    return DecoupledArm(Rigid(referee()), TASK, 0.0 if name == "forward" else DT, forward=name == "forward")


@cache
def run(name: str, plant: str = "torque") -> SimulatedRun:
    substeps = 20 if name == "decoupled two" else SUBSTEPS
    return simulate(referee(), controller(name), TASK, plant=plant, drive=DRIVE, substeps=substeps)


def tip_error(found: SimulatedRun) -> float:
    """Largest distance of the tip from where it should be [m]."""
    return max(float(np.linalg.norm(tip(q) - tip(TASK(t)[0]))) for q, t in zip(found.q, found.times, strict=True))


def at(k: int) -> tuple[Array, Array, Array]:
    return TASK(k * DT)


def step_model(k: int) -> tuple[Array, Array]:
    """Phi and Gamma of step k."""
    A, B = linear_model(ARM, *at(k)).system
    Phi, E = discretised(A, DT)
    return Phi, E @ B
