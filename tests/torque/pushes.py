"""Humanoids that stand in MuJoCo and are pushed, and a plain QP of accelerations and forces as the peer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

import wbc
from tests.backends import way
from tests.judges.quadprog_qp import referee
from tests.pinocchio_state import PinocchioState
from wbc.api import Controller
from wbc.qp import QP
from wbc.robot import Robot
from wbc.shapes import Box, PlacedShape
from wbc.simulation import Command, CommandKind, MujocoPlant, mujoco_model

#: Tick; when a push begins, how long it lasts, how long a run [s]
DT, BEGINS, LASTS, SECONDS = 0.002, 0.05, 0.1, 1.2
FRICTION, G = 0.6, 9.81
#: What the rotor of a G1's joint adds to its inertia, as in MuJoCo Menagerie's unitree_g1 [kg m^2]
ROTOR = 0.01
#: A robot whose centre of mass is below this share of its height has fallen
FALLEN = 0.75


@dataclass(frozen=True, eq=False)
class Stand:
    """A robot on two rectangles of half lengths ``half``, and the frames that tasks are about."""

    robot: Robot
    soles: tuple[str, str]
    half: tuple[float, float]
    chest: str
    hand: str

    @property
    def corners(self) -> np.ndarray:
        """Of a sole, in its frame [4, 3]."""
        return np.array([[x * self.half[0], y * self.half[1], 0.0] for x in (1, -1) for y in (1, -1)])

    @property
    def floor(self) -> float:
        return float(self.robot.pose(self.robot.neutral, self.soles[0]).translation[2])


@cache
def stand(name: str) -> Stand:
    """TALOS or a G1 with limits of acceleration; soles of the G1 are about its contact spheres, and its joints have the
    rotors that its description leaves out: without them 1 N m turns its feet by 4500 rad/s^2.
    """
    robot = wbc.robots.load(name)
    if name == "talos":
        soles, half = ("left_sole_link", "right_sole_link"), (0.1, 0.06)
        return Stand(
            robot.with_limits(acceleration=40.0), soles, half, "torso_2_link", "gripper_right_fingertip_1_link"
        )
    model = robot.model.copy()
    model.armature = np.where(np.arange(model.nv) < 6, 0.0, ROTOR)
    robot = wbc.robots.load(model)
    for side in ("left", "right"):
        under = pin.SE3(np.eye(3), np.array([0.035, 0.0, -0.035]))
        robot = robot.with_frame(f"{side} sole", f"{side}_ankle_roll_link", under)
    robot = robot.with_limits(acceleration=100.0)
    return Stand(robot, ("left sole", "right sole"), (0.085, 0.03), "torso_link", "right_wrist_yaw_link")


@cache
def controller(name: str, backend: str = "auto", soft: float | None = None) -> Controller:
    """Balance, chest, hand and posture on two feet, as in ``examples/mujoco_humanoid.py``."""
    one, tasks = stand(name), wbc.tasks
    stack = wbc.Stack(one.robot, dt=DT)
    stack.add(tasks.CenterOfMass(gain=4.0), name="balance", weight=10.0)
    stack.add(tasks.EndEffector(one.chest, kind="orientation", gain=5.0), name="chest")
    stack.add(tasks.EndEffector(one.hand, kind="position", gain=5.0), name="hand")
    stack.add(tasks.Posture(gain=5.0), name="posture", weight=1e-4)
    stack.add(tasks.JointLimits()).add(tasks.TorqueLimits())
    for sole in one.soles:
        stack.add(tasks.SurfaceContact(sole, half_lengths=one.half, friction=FRICTION), name=sole, soft=soft)
    return stack.compile(command="torque", **way(backend))


class Peer:
    """min sum of weight |task|^2 + 1e3 |feet|^2 over accelerations and forces at the soles' corners, by quadprog: the
    base's rows, friction pyramids and torque limits; no bounds on accelerations.
    """

    def __init__(self, one: Stand) -> None:
        self.one, self.model = one, one.robot.model
        self.start = PinocchioState(self.model, one.robot.neutral, np.zeros(self.model.nv))
        self.weight = G * pin.computeTotalMass(self.model)
        self.last = np.zeros(self.model.nv)

    def torque(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Of all degrees of freedom; the last ones where quadprog finds none."""
        one, nv, state = self.one, self.model.nv, PinocchioState(self.model, q, v)

        def asked(name: str, gain: float) -> np.ndarray:
            """The acceleration that a frame is asked for."""
            frame, start = state.frame(name), self.start.frame(name).pose
            off = np.r_[frame.pose.translation - start.translation, pin.log3(frame.pose.rotation @ start.rotation.T)]
            return -frame.bias - 4.0 * gain * frame.twist - 4.0 * gain**2 * off

        fall = -state.center_bias - 16.0 * state.center_J @ v - 64.0 * (state.center - self.start.center)
        posture = -20.0 * v - 100.0 * pin.difference(self.model, one.robot.neutral, q)
        parts = [
            (state.center_J, fall, 10.0),
            (state.frame(one.chest).J[3:], asked(one.chest, 5.0)[3:], 1.0),
            (state.frame(one.hand).J[:3], asked(one.hand, 5.0)[:3], 1.0),
            (np.eye(nv)[6:], posture[6:], 1e-4),
        ]
        forces = []
        for sole in one.soles:
            frame = state.frame(sole)
            parts.append((frame.J, asked(sole, 5.0), 1e3))
            forces += [frame.J[:3] - pin.skew(frame.pose.rotation @ corner) @ frame.J[3:] for corner in one.corners]
        down, count = np.vstack(forces).T, 3 * len(forces)
        H = np.diag(np.concatenate([np.full(nv, 1e-6), np.full(count, 1e-4 / self.weight**2)]))
        g = np.zeros(nv + count)
        for J, wanted, weight in parts:
            H[:nv, :nv] += weight * J.T @ J
            g[:nv] -= weight * J.T @ wanted
        moved, most = np.hstack([state.M, -down]), np.r_[np.zeros(6), one.robot.limits.effort[6:]]
        mu = FRICTION / np.sqrt(2.0)
        pyramid = np.array([[0, 0, 1], [1, 0, mu], [-1, 0, mu], [0, 1, mu], [0, -1, mu]])
        cones = np.hstack([np.zeros((5 * len(forces), nv)), np.kron(np.eye(len(forces)), pyramid)])
        free, none = np.full(nv + count, np.inf), np.zeros(len(cones))
        lower, upper = np.r_[-free, -most - state.h, none], np.r_[free, most - state.h, none + np.inf]
        x = referee(QP(H, g, lower, upper, np.vstack([moved, cones])))
        if x is not None:
            self.last = np.clip(moved @ x + state.h, -most, most)
        return self.last


@dataclass(frozen=True)
class Outcome:
    """Of a push: whether the robot fell; how far inside the soles' hull its capture point was during the push, at least
    [m]; the largest rate and torque, of their limits.
    """

    fell: bool
    inside: float
    rate: float
    torque: float


@cache
def _plant(name: str) -> MujocoPlant:
    one = stand(name)
    sole = Box((2.0 * one.half[0], 2.0 * one.half[1], 0.02))
    boxes = {f: [PlacedShape(sole, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01])))] for f in one.soles}
    model = mujoco_model(one.robot, time_step=DT / 2, contacts=boxes, ground=one.floor, friction=0.8, drawn=False)
    return MujocoPlant(model, one.robot)


def pushed(name: str, torque: Callable[[np.ndarray, np.ndarray], np.ndarray], impulse: np.ndarray) -> Outcome:
    """The robot stands and is pushed at its chest; ``impulse`` [N s] along the world's x and y."""
    one, plant = stand(name), _plant(name)
    robot, q = one.robot, one.robot.neutral
    model, data = robot.model, robot.model.createData()
    plant.reset(q, 0.0)
    hull = ConvexHull(np.vstack([robot.pose(q, f).act(c)[:2] for f in one.soles for c in one.corners])).equations
    height = float(pin.centerOfMass(model, data, q)[2]) - one.floor
    inside, rate, share = np.inf, 0.0, 0.0
    for k in range(round(SECONDS / DT)):
        state, t = plant.read(), DT * k
        center, speed = pin.centerOfMass(model, data, state.q, state.v), data.vcom[0]
        if BEGINS <= t <= BEGINS + LASTS + DT:
            capture = center[:2] + speed[:2] * np.sqrt(height / G)
            inside = min(inside, float(-(hull[:, :2] @ capture + hull[:, 2]).max()))
        if center[2] - one.floor < FALLEN * height:
            return Outcome(True, inside, rate, share)
        rate = max(rate, float(np.abs(state.v[6:] / robot.limits.velocity[6:]).max()))
        sent = torque(state.q, state.v)
        share = max(share, float(np.abs(sent[6:] / robot.limits.effort[6:]).max()))
        force = impulse / LASTS if BEGINS <= t < BEGINS + LASTS else np.zeros(2)
        plant.data.body(one.chest).xfrc_applied[:2] = force
        plant.apply(Command(CommandKind.TORQUE, sent))
        plant.advance(DT)
    return Outcome(False, inside, rate, share)
