"""Criteria of steps by name, of a machine on its way."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.errors import RangeError
from wbc.published.ikor.machines import ArmMachine
from wbc.published.ikor.settings import DT
from wbc.resolvers.fsp import Criterion, least_acceleration, least_power, least_torque
from wbc.validation import Array


def step_criterion(machine: ArmMachine, name: str, q: Array, last: Array) -> Criterion:
    """What is least of the next step, of :data:`wbc.published.ikor.settings.CRITERIA`; ``last``: the step before [M].

    Raises:
        RangeError: masses that a criterion needs and the machine has not.
    """
    weight = None if (machine.weights == 1.0).all() else machine.weights**2
    if name == "norm":
        return Criterion(weight)
    if name == "acceleration":
        return least_acceleration(last, weight)
    model, data, at = machine.robot.model, machine.robot.model.createData(), machine.of_robot(q)
    upper = np.triu(pin.crba(model, data, at))
    inertia = machine.spread.T @ (upper + np.triu(upper, 1).T) @ machine.spread
    if np.linalg.eigvalsh(inertia)[0] <= 0.0:
        raise RangeError("criterion", name, f"a joint of {machine.name} moves no mass; take norm or acceleration")
    if name == "energy":
        return Criterion(inertia)
    bias = machine.spread.T @ pin.nonLinearEffects(model, data, at, machine.spread @ last / DT)
    way = least_power(inertia, bias, last / DT, DT)
    if name == "torque":
        way = least_torque(inertia, bias, last / DT, DT, weight)
    # Of rates; a step is DT of them
    assert way.reference is not None
    return Criterion(way.weight, DT * way.reference)
