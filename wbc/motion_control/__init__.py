"""Torques that follow a motion by a model: computed torque, adaptive control, impedance, one step ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.motion_control.actuators import (
        Actuator as Actuator,
        ActuatorSizing as ActuatorSizing,
        Bound as Bound,
        read_actuators as read_actuators,
    )
    from wbc.motion_control.adaptive import AdaptiveControl as AdaptiveControl
    from wbc.motion_control.computed_torque import ComputedTorque as ComputedTorque
    from wbc.motion_control.impedance import Impedance as Impedance
    from wbc.motion_control.motion import (
        Motion as Motion,
        TorqueController as TorqueController,
        largest_step as largest_step,
    )
    from wbc.motion_control.perturbation import OneStepPerturbation as OneStepPerturbation
    from wbc.motion_control.stack_tracking import StackTracking as StackTracking
    from wbc.motion_control.trial import Trial as Trial, loaded as loaded, run_trial as run_trial
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
