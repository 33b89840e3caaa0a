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
from bench.descriptions import write_urdf
from bench.measured.ticks import median_at
from bench.prepare import DESCRIPTIONS
from bench.sheet import Sheet, us
from wbc.api import Controller, Stack
from wbc.robot import Robot
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Posture, RigidGrasp, SurfaceContact, TorqueLimits

#: Where placo is installed, see the Makefile
PEERS = Path(".venv-peers/bin/python")
#: Joints of the Panda that are fixed, as in its table of robots
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
DT, STATES, TICKS, TURNS = 0.002, 64, 600, 5
FOOT = {"half_lengths": (0.1, 0.06), "friction": 0.6}


def parts() -> dict[str, Sheet | str]:
    """Three robots; placo's dynamics solver on two of them."""
    rows = []
    arm, states = fixed_arm(), near(wbc.robots.load("panda"), 0.05)
    target = wbc.robots.load("panda").neutral
    before = median(arm.compile(wait=True), states, target)
    rows.append(("Panda, hand and posture: velocities", us(before), ""))
    arm.add(TorqueLimits())
    peer = placo("panda_description/urdf/panda.urdf", states, False, ["panda_hand"], False, [])
    rows.append(
        (
            "the same: torques with their limits",
            us(median(arm.compile(command="torque", wait=True), states, target)),
            peer,
        )
    )
    grips = two_grips()
    states = near(grips.robot, 0.001)
    rows.append(
        ("three-armed walker, two grips", us(median(grips.compile(command="torque", wait=True), states, None)), "")
    )
    stack = humanoid()
    states = near(stack.robot, 0.002)
    contacts = [{"kind": "surface", "frame": f"{side}_sole_link", **FOOT} for side in ("left", "right")]
    contacts.append({"kind": "grasp", "frame": "gripper_right_base_link"})
    peer = placo("talos_data/robots/talos_reduced.urdf", states, True, [], True, contacts)
    ours = us(median(stack.compile(command="torque", wait=True), states, None))
    rows.append(("Talos, two surface contacts and a hand", ours, peer))
    columns = ("one tick, median [us]", "wbc", "placo")
    return {"cost": Sheet("", columns, rows)}


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


def placo(
    description: str, states: list[np.ndarray], floating: bool, frames: list[str], com: bool, contacts: list[object]
) -> str:
    """placo's median tick [us] on the same robot, states and contacts; empty where it is not installed."""
    if not PEERS.exists():
        return ""
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "robot.urdf"
        write_urdf(DESCRIPTIONS / description, urdf, locked=() if floating else FINGERS)
        problem = {
            "urdf": str(urdf),
            "dt": DT,
            "floating": floating,
            "states": [q.tolist() for q in states],
            "frames": frames,
            "com": com,
            "contacts": contacts,
        }
        file = Path(folder) / "problem.json"
        file.write_text(json.dumps(problem))
        done = subprocess.run(
            [str(PEERS.absolute()), "-m", "bench.torque_peer", str(file)], stdout=subprocess.PIPE, text=True, check=True
        )
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["solved"] > 0.99, found
    return us(found["us"])
