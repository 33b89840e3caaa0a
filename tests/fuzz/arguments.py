"""Good arguments by the names of parameters: what random calls spoil."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.fuzz.arm import CUBE, DT, HULL, MIDDLE, ONE, ROWS, TIP, Q, height, item, plain, robot, stack, stack_of_poses
from tests.models import placement
from wbc import shapes, tasks, trajectory
from wbc.proximity import Body


def _box() -> Body:
    return Body("box", "world", pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.0])), shapes.Box((0.1, 0.1, 0.1)))


def _bodies() -> list[tuple[Body, Body]]:
    return [(Body("arm", "link3", ONE, shapes.Capsule(0.05, 0.2)), _box())]


def _pose(x: float, turn: float = 0.3) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), np.array([x, 0.1, 0.0]))


_TRIPLE = (0.0, 0.0, 1.0)
#: (class or function.)parameter -> a good value
GOOD: dict[str, Callable[[Any], Any]] = {
    "robot": lambda g: robot(), "stack": lambda g: plain(), "q": lambda g: Q, "q0": lambda g: Q,
    "v": lambda g: 0.1 * Q, "dt": lambda g: DT, "frame": lambda g: TIP, "frame_a": lambda g: TIP,
    "frame_b": lambda g: MIDDLE, "shoulder": lambda g: "link1", "elbow": lambda g: MIDDLE, "wrist": lambda g: TIP,
    "joint": lambda g: "joint1", "joints": lambda g: ("joint1", "joint2"), "kind": lambda g: "position",
    "axis": lambda g: _TRIPLE, "direction": lambda g: _TRIPLE, "offset": lambda g: _TRIPLE,
    "point": lambda g: _TRIPLE, "apex": lambda g: _TRIPLE, "around": lambda g: _TRIPLE, "pole": lambda g: _TRIPLE,
    "at": lambda g: _TRIPLE, "relative_to": lambda g: "link1", "shoulder_offset": lambda g: _TRIPLE,
    "elbow_offset": lambda g: _TRIPLE, "wrist_offset": lambda g: _TRIPLE, "point_frame": lambda g: "link1",
    "axes": lambda g: "world", "base": lambda g: "world", "name": lambda g: "new", "gain": lambda g: 2.0,
    "weight": lambda g: 1.0, "weights": lambda g: (1.0, 2.0, 3.0), "half_angle": lambda g: 0.5,
    "width": lambda g: 0.05, "margin": lambda g: 0.01, "closest": lambda g: 2, "corners": lambda g: 2,
    "rate": lambda g: None, "price": lambda g: 2.0, "level": lambda g: 0, "damping": lambda g: 1e-6,
    "length": lambda g: 0.5, "radius": lambda g: 0.1, "size": lambda g: (0.1, 0.2, 0.3), "points": lambda g: CUBE,
    "calm": lambda g: True, "hard": lambda g: True, "soft": lambda g: None, "scaled": lambda g: False,
    "mask": lambda g: 1.0, "enabled": lambda g: True, "target": lambda g: np.array([0.2, 0.6, 0.0]),
    "feedforward": lambda g: np.zeros(3), "pose": lambda g: _pose(0.5), "seconds": lambda g: 0.1,
    "shape": lambda g: shapes.Sphere(0.1), "placement": lambda g: _pose(0.1), "excess": lambda g: 0.0,
    "solver": lambda g: "daqp", "backend": lambda g: "vm", "goals": lambda g: ["hand"], "item": lambda g: item(),
    "targets": lambda g: {"hand": [np.array([0.2, 0.6, 0.0]), np.array([0.3, 0.6, 0.0])]}, "seed": lambda g: 1,
    "budget": lambda g: 0.01, "restarts": lambda g: 3, "tolerance": lambda g: 1e-4, "workers": lambda g: 1,
    "most": lambda g: 1, "s": lambda g: np.array([0.0, 1.0]), "limits": lambda g: _limits(),
    "path": lambda g: str(g.folder / "new"), "file": lambda g: str(g.folder / "good.law"),
    "folder": lambda g: str(g.folder / "tick"), "overwrite": lambda g: True, "states": lambda g: 2,
    "recording": lambda g: str(g.folder / "good.rec"), "value": lambda g: "target", "trust": lambda g: True,
    "pairs": lambda g: (("link1", "link3"),), "rows": lambda g: list(ROWS), "tool": lambda g: _pose(0.1),
    "neutral": lambda g: {"joint1": 0.1}, "lock": lambda g: {"joint2": 0.1}, "shapes": lambda g: "auto",
    "package_dirs": lambda g: [str(g.folder)], "position_lower": lambda g: {"joint1": -1.0},
    "position_upper": lambda g: [1.0, 1.0, 1.0], "velocity": lambda g: np.ones(3), "jerk": lambda g: np.full(3, 10.0),
    "acceleration": lambda g: np.full(3, 2.0), "effort": lambda g: np.ones(3), "lower": lambda g: np.full(3, -3.0),
    "upper": lambda g: np.full(3, 3.0), "changes": lambda g: {"velocity": 0.5}, "parent": lambda g: MIDDLE,
    "field": lambda g: "field", "field_name": lambda g: "field", "links": lambda g: ["link1"], "count": lambda g: 2,
    "samples": lambda g: 20, "clearance": lambda g: 0.0, "mesh": lambda g: CUBE, "scale": lambda g: 1.0,
    "arms": lambda g: 3, "two_ended": lambda g: False, "start": lambda g: np.zeros(3), "end": lambda g: Q,
    "start_velocity": lambda g: 0.1 * Q, "target_velocity": lambda g: 0.1 * Q,
    "start_acceleration": lambda g: 0.1 * Q, "target_acceleration": lambda g: 0.1 * Q,
    "synchronisation": lambda g: "time", "straight": lambda g: False, "stops": lambda g: True, "cells": lambda g: 20,
    "dof": lambda g: 3, "t": lambda g: np.array([0.1, 0.2]), "factor": lambda g: 2.0, "position": lambda g: Q,
    "order": lambda g: 1, "other": lambda g: g.subjects["law"](), "law": lambda g: g.subjects["law"](),
    "waypoints": lambda g: np.array([np.zeros(3), Q, -Q]), "deviation": lambda g: 0.01, "ends": lambda g: "natural",
    "speed": lambda g: 1.0, "angular_acceleration": lambda g: 1.0, "angular_speed": lambda g: 1.0,
    "poses": lambda g: [_pose(0.0), _pose(0.5, 0.6), _pose(1.0)], "turn_deviation": lambda g: 0.1,
    "via": lambda g: _pose(0.5, 0.6), "center": lambda g: np.array([0.0, 1.0, 0.0]), "turn": lambda g: _TRIPLE,
    "knots": lambda g: [0.0, 1.0], "coefficients": lambda g: [[[0.0, 1.0, 2.0]]], "times": lambda g: [0.0, 1.0],
    "timing": lambda g: trajectory.Timing.identity(1.0), "shift": lambda g: 0.0, "duration": lambda g: 5.0,
    "tasks": lambda g: item(), "task": lambda g: item(), "wheels": lambda g: (tasks.Wheel("joint1", 0.1),),
    "normals": lambda g: ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), "offsets": lambda g: (1.0, 2.0), "linear": lambda g: 0.5,
    "angular": lambda g: 0.5, "function": lambda g: height, "units": lambda g: "m",
    "inputs": lambda g: (tasks.Input("level", unit="m", default=0.1),), "labels": lambda g: ("one",),
    "unit": lambda g: "m", "default": lambda g: np.zeros(3), "low": lambda g: -1.0, "high": lambda g: 1.0,
    "torque": lambda g: None, "cartesian_speed": lambda g: None, "start_speed": lambda g: 0.0,
    "intervals": lambda g: 20, "end_speed": lambda g: 0.0, "cap": lambda g: 5, "policy": lambda g: wbc.Policy(),
    "names": lambda g: ["a", "b", "c"], "title": lambda g: "Law", "found": lambda g: g.subjects["pairs"](),
    "convention": lambda g: "standard", "conflict": lambda g: "elastic", "chain": lambda g: ("cold",),
    "progress": lambda g: None, "data": lambda g: None, "body_shape": lambda g: "capsules",
    "orientation": lambda g: "carried", "shortest_dt": lambda g: 0.005, "return_rate": lambda g: 5.0,
    "srdf": lambda g: None, "method": lambda g: "sensed", "form": lambda g: "log",
    "reference": lambda g: tasks.PlaneReference(), "given": lambda g: Q, "a": lambda g: 0.4, "alpha": lambda g: 0.1,
    "d": lambda g: 0.1, "theta": lambda g: 0.1, "DHRow.joint": lambda g: "revolute", "DHRow.lower": lambda g: -1.0,
    "DHRow.upper": lambda g: 1.0, "DHRow.velocity": lambda g: 1.0, "DHRow.acceleration": lambda g: 1.0,
    "DHRow.effort": lambda g: 1.0, "robots.load.robot": lambda g: list(ROWS), "robots.load.base": lambda g: None,
    "robots.from_dh.base": lambda g: None, "robots.load.velocity": lambda g: 1.0,
    "robots.operator_arm.name": lambda g: "ssrms", "Fixed.acceleration": lambda g: True,
    "robots.from_dh.limits": lambda g: {"velocity": 1.0}, "Robot.with_frame.placement": lambda g: _pose(0.1),
    "robots.read_self_pairs.path": lambda g: str(g.folder / "pairs.toml"), "Walker.arm.name": lambda g: "arm1",
    "robots.save_self_pairs.path": lambda g: str(g.folder / "new.toml"),
    "robots.fit_shapes.kind": lambda g: "capsule",
    "Robot.with_shapes.shapes": lambda g: {"link1": [shapes.PlacedShape(shapes.Sphere(0.1), ONE)]},
    "Damping.weights": lambda g: (1.0, 2.0, 3.0), "CenterOfMass.weights": lambda g: (1.0, 2.0, 3.0),
    "Momentum.kind": lambda g: "linear", "Momentum.weights": lambda g: (1.0, 2.0, 3.0),
    "EndEffector.axes": lambda g: "reference", "RelativePose.axes": lambda g: "midway",
    "Expression.weights": lambda g: (1.0,), "Posture.weights": lambda g: (1.0, 2.0),
    "Posture.start": lambda g: "neutral", "JointLimits.position": lambda g: True,
    "JointLimits.velocity": lambda g: True, "JointLimits.acceleration": lambda g: True,
    "JointCoupling.coefficients": lambda g: {"joint1": 1.0, "joint2": -2.0}, "JointCoupling.target": lambda g: 0.1,
    "JointCoupling.weights": lambda g: (1.0,), "Input.kind": lambda g: "vector", "Input.size": lambda g: 3,
    "Recording.path": lambda g: str(g.folder / "good.rec"), "Input.direction": lambda g: False,
    "Input.name": lambda g: "level", "Rolling.gain": lambda g: 2.0, "Limit.lower": lambda g: -1.0,
    "Limit.upper": lambda g: 1.0, "WorkspaceBox.lower": lambda g: (-1.0, -1.0, -1.0),
    "WorkspaceBox.upper": lambda g: (1.0, 1.0, 1.0), "Capsule.length": lambda g: 0.2, "Stack.length": lambda g: 0.5,
    "Manipulability.length": lambda g: 0.5, "PitchPlane.axis": lambda g: "link1",
    "PitchPlaneLimit.axis": lambda g: "link1", "Limits.acceleration": lambda g: np.ones(3),
    "Law.path": lambda g: trajectory.straight_path(np.zeros(3), Q),
    "trajectory.time_optimal.path": lambda g: g.subjects["path"](),
    "trajectory.jerk_limited_along.path": lambda g: _zigzag(), "trajectory.follow.poses": lambda g: _short(),
    "trajectory.follow.start": lambda g: Q, "trajectory.follow.task": lambda g: "hand",
    "trajectory.follow.stack": lambda g: stack_of_poses(),
    "trajectory.plot.file": lambda g: str(g.folder / "plot.png"),
    "trajectory.function_path.function": lambda g: lambda s: np.array([np.sin(s), s, 0.0]),
    "trajectory.function_path.start": lambda g: 0.0, "trajectory.function_path.end": lambda g: 1.0,
    "trajectory.geodesic_path.start": lambda g: _pose(0.0), "trajectory.geodesic_path.end": lambda g: _pose(1.0),
    "trajectory.arc_path.start": lambda g: _pose(0.0), "trajectory.arc_through.start": lambda g: _pose(0.0),
    "trajectory.arc_through.end": lambda g: _pose(1.0), "trajectory.via_points.acceleration": lambda g: 1.0,
    "trajectory.jerk_limited.target": lambda g: Q, "trajectory.blend_path.deviation": lambda g: 0.01,
    "Law.sliced.start": lambda g: 0.1, "Law.sliced.end": lambda g: 0.2, "Timing.sliced.start": lambda g: 0.1,
    "Timing.sliced.end": lambda g: 0.2, "Timing.identity.start": lambda g: 0.0,
    "Timing.other": lambda g: trajectory.Timing.identity(1.0), "Online.target.position": lambda g: 5.0 * Q,
    "proximity.distances.pairs": lambda g: _bodies(), "proximity.witnesses.pairs": lambda g: _bodies(),
    "Body.frame": lambda g: "link3", "Body.name": lambda g: "body",
    "InverseKinematics.along.targets": lambda g: {"hand": [np.array([0.2, 0.6, 0.0]), np.array([0.3, 0.6, 0.0])]},
    "Stack.solve.targets": lambda g: {"hand": np.array([0.2, 0.6, 0.0])},
    "Stack.solve.options": lambda g: {"restarts": 2}, "Step.derivative.name": lambda g: "hand",
    "Controller.__getitem__.name": lambda g: "hand", "Controller.pairs.name": lambda g: "box",
    "Handle.rate=.given": lambda g: 2.0, "Handle.price=.given": lambda g: 2.0,
    "Handle.enabled=.given": lambda g: True, "Handle.mask=.given": lambda g: 1.0,
    "Handle.weight=.given": lambda g: 2.0, "Handle.gain=.given": lambda g: 2.0,
    "Handle.pose=.given": lambda g: _pose(0.5), "Handle.level=.given": lambda g: 0.2,
    "Handle.values": lambda g: {"target": Q}, "Controller.iteration_cap=.given": lambda g: 5,
    "Controller.policy=.given": lambda g: wbc.Policy(), "Stack.stack": lambda g: stack(),
    "PlaneReference.direction": lambda g: (1.0, 0.0, 0.0), "Input.below": lambda g: None,
    "Input.infinite": lambda g: None, "Input.sensed": lambda g: False, "PitchPlaneLimit.lower": lambda g: -0.5,
    "PitchPlaneLimit.upper": lambda g: 0.5, "Law.file": lambda g: str(g.folder / "new.law"),
    "robots.convex_parts.triangles": lambda g: HULL, "Timing.speed": lambda g: np.array([0.1, 0.2]),
    "Handle.margin=.given": lambda g: 0.02, "Handle.velocity=.given": lambda g: np.zeros(6),
    "Handle.return_rate=.given": lambda g: 3.0, "Handle.velocity_scale=.given": lambda g: 0.5,
    "Handle.target=.given": lambda g: np.array([0.2, 0.6, 0.0]), "Handle.feedforward=.given": lambda g: np.zeros(3),
    "robots.convex_parts.mesh": lambda g: CUBE, "Limits.position_lower": lambda g: -np.ones(3),
    "Limits.position_upper": lambda g: np.ones(3), "PitchPlaneLimit.line_width": lambda g: 0.05,
    "PitchPlaneLimit.elbow_width": lambda g: 0.05, "PitchPlaneLimit.reference_width": lambda g: 0.05,
    "PitchPlane.line_width": lambda g: 0.05, "PitchPlane.elbow_width": lambda g: 0.05, "checks": lambda g: (),
    "PitchPlane.reference_width": lambda g: 0.05, "Law.timing": lambda g: trajectory.Timing.identity(0.9),
    "Law.limits": lambda g: _limits(), "moving": lambda g: (False, False), "Timing.knots": lambda g: [0.0, 1.0],
    "trajectory.arc_through.via": lambda g: np.array([0.5, 0.6, 0.0]), "Stack.__getitem__.name": lambda g: "hand",
    "trajectory.online.velocity": lambda g: np.ones(3), "InverseKinematics.__getitem__.name": lambda g: "hand",
    "Law.with_limits.limits": lambda g: _limits(), "Timing.coefficients": lambda g: [[0.0], [1.0]],
}  # fmt: skip


def _limits() -> Any:
    return trajectory.MotionLimits(velocity=np.ones(3), acceleration=np.ones(3), jerk=np.ones(3))


def _zigzag() -> Any:
    return trajectory.blend_path(np.array([np.zeros(3), Q, -Q]), 0.01)


def _short() -> Any:
    place = robot()
    start = placement(place, TIP, Q)
    return trajectory.geodesic_path(start, pin.SE3(start.rotation, start.translation + np.array([0.02, 0.0, 0.0])))
