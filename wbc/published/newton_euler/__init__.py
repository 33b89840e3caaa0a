"""The published simulator of arms by Newton and Euler, and its three controllers of a three-link arm.

Source: a thesis on a simulator in PL/1 with a modified Stanford arm; title page and figures of the copy are lost. What
its print has wrong is put right here and shown in tests/published/test_newton_euler_controllers.py.
"""

from __future__ import annotations

from wbc.published.newton_euler.actuators import DriveTrain as DriveTrain, Motor as Motor, discretised as discretised
from wbc.published.newton_euler.control import (
    Adaptive as Adaptive,
    Estimator as Estimator,
    Linearised as Linearised,
    Nominal as Nominal,
    OneStep as OneStep,
    gain as gain,
)
from wbc.published.newton_euler.decoupling import (
    DecoupledArm as DecoupledArm,
    DecoupledTwo as DecoupledTwo,
    Decoupling as Decoupling,
)
from wbc.published.newton_euler.dynamics import ArmDynamics as ArmDynamics, Rigid as Rigid
from wbc.published.newton_euler.links import Link as Link, SerialChain as SerialChain
from wbc.published.newton_euler.recursion import (
    Equations as Equations,
    External as External,
    LinearModel as LinearModel,
    equations as equations,
    linear_model as linear_model,
)
from wbc.published.newton_euler.simulation import SimulatedRun as SimulatedRun, simulate as simulate
