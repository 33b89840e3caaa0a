"""The published simulator of arms by Newton and Euler, and its three controllers of a three-link arm.

Source: a thesis on a simulator in PL/1 with a modified Stanford arm; title page and figures of the copy are lost. What
its print has wrong is put right here and shown in tests/published/test_newton_euler_controllers.py.
"""

from __future__ import annotations

from wbc.published.newton_euler.actuators import DriveTrain, Motor, discretised
from wbc.published.newton_euler.control import Adaptive, Estimator, Linearised, Nominal, OneStep, gain
from wbc.published.newton_euler.decoupling import DecoupledArm, DecoupledTwo, Decoupling
from wbc.published.newton_euler.dynamics import ArmDynamics, Rigid
from wbc.published.newton_euler.links import Link, SerialChain
from wbc.published.newton_euler.recursion import Equations, External, LinearModel, equations, linear_model
from wbc.published.newton_euler.simulation import SimulatedRun, simulate

__all__ = [
    "Adaptive",
    "ArmDynamics",
    "DecoupledArm",
    "DecoupledTwo",
    "Decoupling",
    "DriveTrain",
    "Equations",
    "Estimator",
    "External",
    "LinearModel",
    "Linearised",
    "Link",
    "Motor",
    "Nominal",
    "OneStep",
    "Rigid",
    "SerialChain",
    "SimulatedRun",
    "discretised",
    "equations",
    "gain",
    "linear_model",
    "simulate",
]
