"""What a tick of torques costs: a fixed arm, two grips, and a humanoid on its feet, beside placo."""

from __future__ import annotations

import json
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

import wbc
from bench.descriptions import write_robot
from bench.harness import PEERS_PYTHON
from bench.measured.ticks import median_at
from bench.sheet import Sheet, us
from wbc.api import Controller, Stack
from wbc.robot import Robot
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Posture, RigidGrasp, SurfaceContact, TorqueLimits

DT, STATES, TICKS, TURNS = 0.002, 64, 600, 5
FOOT = {"half_lengths": (0.1, 0.06), "friction": 0.6}


def parts() -> dict[str, Sheet | str]:
    """Three robots; placo's dynamics solver on two of them."""
    arm = fixed_arm()
    states, target = near(arm.robot, 0.05), arm.robot.neutral
    velocities = median(arm.compile(wait=True), states, target)
    torques = median(arm.add(TorqueLimits()).compile(command="torque", wait=True), states, target)
    rows = [
        ("Panda, hand and posture: velocities", us(velocities), ""),
        ("the same: torques with their limits", us(torques), placo(arm.robot, states, ["panda_hand"], False, [])),
    ]
    grips, stack = two_grips(), humanoid()
    ticked = median(grips.compile(command="torque", wait=True), near(grips.robot, 0.001), None)
    rows.append(("three-armed walker, two grips", us(ticked), ""))
    states = near(stack.robot, 0.002)
    contacts = [{"kind": "surface", "frame": f"{side}_sole_link", **FOOT} for side in ("left", "right")]
    contacts.append({"kind": "grasp", "frame": "gripper_right_base_link"})
    peer = placo(stack.robot, states, [], True, contacts)
    ticked = median(stack.compile(command="torque", wait=True), states, None)
    rows.append(("Talos, two surface contacts and a hand", us(ticked), peer))
    return {"cost": Sheet("", ("one tick, median [us]", "wbc", "placo"), rows)}


def fixed_arm() -> Stack:
    """A Panda."""
    stack = Stack(wbc.robots.load("panda"), dt=DT)
    stack.add(EndEffector("panda_hand"), name="hand")
    stack.add(Posture(), name="posture", weight=1e-2)
    return stack.add(JointLimits())


def two_grips() -> Stack:
    """The walker with masses, in zero gravity."""
    bare = wbc.robots.load("walker")
    model = bare.model.copy()
    for j in range(1, model.njoints):
        model.inertias[j] = pin.Inertia.FromBox(60.0 if j == 1 else 3.0, 0.2, 0.2, 0.3)
    model.gravity.linear = np.zeros(3)
    effort = np.where(np.arange(bare.nv) < 6, np.inf, 200.0)
    stack = Stack(replace(bare, model=model, limits=bare.limits.override(effort=effort)), dt=DT)
    stack.add(EndEffector("arm3_hand"), name="hand")
    stack.add(Posture(), name="posture", weight=1e-2)
    stack.add(JointLimits()).add(TorqueLimits())
    for arm in (1, 2):
        stack.add(RigidGrasp(f"arm{arm}_hand", force=300.0, torque=80.0), name=f"grip {arm}")
    return stack


def humanoid() -> Stack:
    """Talos on two feet, a hand on a wall."""
    stack = Stack(wbc.robots.load("talos"), dt=DT)
    stack.add(CenterOfMass(), name="com")
    stack.add(Posture(), name="posture", weight=1e-2)
    stack.add(JointLimits()).add(TorqueLimits())
    for side in ("left", "right"):
        stack.add(SurfaceContact(f"{side}_sole_link", FOOT["half_lengths"], FOOT["friction"]), name=f"{side} foot")
    return stack.add(RigidGrasp("gripper_right_base_link"), name="hand")


def near(robot: Robot, size: float) -> list[np.ndarray]:
    """Configurations about neutral."""
    rng = np.random.default_rng(1)
    out = [pin.integrate(robot.model, robot.neutral, size * rng.normal(size=robot.nv)) for _ in range(STATES)]
    limits = robot.limits
    for q in out:
        for i, k in enumerate(robot.position_index):
            if k >= 0:
                q[k] = np.clip(q[k], limits.position_lower[i] + 0.01, limits.position_upper[i] - 0.01)
    return out


def median(controller: Controller, states: list[np.ndarray], target: np.ndarray | None) -> float:
    """Median tick [us] at rest at these states, of the quickest of some turns."""
    controller.reset(controller.stack.robot.neutral)
    if target is not None:
        goal = controller["hand"].target.copy()
        goal.translation += 0.05
        controller["hand"].target = goal
    return median_at(controller, states, np.zeros(controller.stack.robot.nv), TICKS, TURNS)


def placo(robot: Robot, states: list[np.ndarray], frames: list[str], com: bool, contacts: list[object]) -> str:
    """placo's median tick [us] on the same robot, states and contacts; empty where it is not installed."""
    if not PEERS_PYTHON.exists():
        return ""
    with tempfile.TemporaryDirectory() as folder:
        urdf, file = Path(folder) / "robot.urdf", Path(folder) / "problem.json"
        write_robot(robot, urdf)
        problem = {
            "urdf": str(urdf), "dt": DT, "floating": robot.base == "floating", "states": [q.tolist() for q in states],
            "frames": frames, "com": com, "contacts": contacts,
        }  # fmt: skip
        file.write_text(json.dumps(problem))
        command = [PEERS_PYTHON, "-m", "bench.torque_peer", file]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["solved"] > 0.99, found
    return us(found["us"])
