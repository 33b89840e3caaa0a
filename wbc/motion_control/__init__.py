"""Torques that follow a motion by a model: computed torque, adaptive control, impedance, one step ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.motion_control.actuators import Actuator, ActuatorSizing, Bound, read_actuators
    from wbc.motion_control.adaptive import AdaptiveControl
    from wbc.motion_control.computed_torque import ComputedTorque
    from wbc.motion_control.impedance import Impedance
    from wbc.motion_control.motion import Motion, TorqueController, largest_step
    from wbc.motion_control.perturbation import OneStepPerturbation
    from wbc.motion_control.stack_tracking import StackTracking
    from wbc.motion_control.trial import Trial, loaded, run_trial
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "Actuator",
    "ActuatorSizing",
    "AdaptiveControl",
    "Bound",
    "ComputedTorque",
    "Impedance",
    "Motion",
    "OneStepPerturbation",
    "StackTracking",
    "TorqueController",
    "Trial",
    "largest_step",
    "loaded",
    "read_actuators",
    "run_trial",
]


def __dir__() -> list[str]:
    return __all__
