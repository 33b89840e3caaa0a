"""Sizes of symbolic expressions."""

from __future__ import annotations

import casadi as ca

import wbc.robots
from bench.sheet import Sheet
from tests.symbolic.test_tracer import CASES, EXPRESSIONS, functions
from wbc.symbolic import Centroidal, Dynamics, Kinematics, Velocities

ROBOTS = {
    "Panda, 9 dof": (("panda", {"lock": ()}), "panda_hand_tcp"),
    "Talos, floating, 38 dof": (("talos", {}), "arm_left_7_link"),
}


def parts() -> dict[str, Sheet | str]:
    """Instructions of quantities, and of Jacobians by placeholders and by plain differentiation."""
    columns = {label: sizes(name, options, frame) for label, ((name, options), frame) in ROBOTS.items()}
    rows = [
        (quantity, *(f"{found[quantity]}" for found in columns.values())) for quantity in next(iter(columns.values()))
    ]
    tracer = []
    for name in EXPRESSIONS:
        pairs = [functions(robot, name)[1:] for robot in CASES]
        tracer.append((name, *(f"{own.n_instructions()} / {plain.n_instructions()}" for own, plain in pairs)))
    return {
        "sizes": Sheet("", ("instructions", *ROBOTS), rows),
        "tracer": Sheet("", ("Jacobian of", *CASES), tracer),
    }


def sizes(name: str, options: dict[str, object], frame: str) -> dict[str, int]:
    """Quantity -> instructions of its function."""
    kin = Kinematics(wbc.robots.load(name, **options).model)
    motion = Velocities(kin)
    dynamics = Dynamics(kin, motion)
    centroidal = Centroidal(dynamics)
    pose = kin.pose(frame)
    found = {
        "pose of a frame": ca.vertcat(pose.position, ca.vec(pose.rotation)),
        "Jacobian of a frame": kin.jacobian(frame, "world_aligned"),
        "twist of a frame": motion.frame_velocity(frame, "world_aligned"),
        "centre of mass": kin.center_of_mass,
        "its Jacobian": kin.center_of_mass_jacobian,
        "centroidal momentum": centroidal.momentum,
        "inverse dynamics": dynamics.inverse_dynamics,
        "nonlinear effects": dynamics.nonlinear_effects,
        "gravity": dynamics.gravity,
        "mass matrix": dynamics.mass_matrix,
        "kinetic energy": dynamics.kinetic_energy,
    }
    symbols = [kin.q, kin.v, dynamics.a]
    return {quantity: ca.Function("f", symbols, [value]).n_instructions() for quantity, value in found.items()}
