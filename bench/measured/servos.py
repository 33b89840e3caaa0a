"""How far a hand is off its path on servos in MuJoCo: what users write by hand, and wbc.servo.Servo."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from bench.pool import ROOT
from bench.sheet import Sheet
from wbc.api import Controller
from wbc.robot import Robot
from wbc.servo import Servo
from wbc.simulation import Command, CommandKind, MujocoPlant

ARM = ROOT / "bench" / "servo_arm.xml"
HOME = np.array([0.0, 0.3, 0.0, -1.6, 0.0, 1.8, 0.0])
DT, TICKS, SETTLED = 0.001, 4000, 500
KINDS = (CommandKind.POSITION, CommandKind.VELOCITY, CommandKind.TORQUE)


#: Stiffness of servos of positions [N m/rad]
STIFFNESS = 2000.0
#: Lag of theirs [s]
LAG = 0.1
#: Gain of servos of velocities [N m s/rad]
DRIVE = 200.0
#: Damping of joints [N m s/rad]
DAMPING = 1.0


def plant_of(kind: CommandKind, robot: Robot) -> MujocoPlant:
    """The arm on servos of a kind; those of velocities come with compensation of gravity."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(ARM))
    gains = {
        "position": (STIFFNESS, 0, -STIFFNESS, -STIFFNESS * LAG), "velocity": (DRIVE, 0, 0, -DRIVE),
        "torque": (1, 0, 0, 0),
    }[kind]  # fmt: skip
    model.actuator_gainprm[:, 0], model.actuator_biasprm[:, :3] = gains[0], gains[1:]
    model.dof_damping[:], model.dof_frictionloss[:] = DAMPING, 0.0
    model.body_gravcomp[1:] = float(kind is CommandKind.VELOCITY)
    return MujocoPlant(model, robot)


def controller() -> Controller:
    """A hand, a posture and limits."""
    robot = wbc.robots.load(ARM, velocity=2.0, acceleration=10.0)
    stack = wbc.Stack(robot, dt=DT)
    stack.add(wbc.tasks.EndEffector("tool", gain=10.0), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.JointLimits())
    return stack.compile(wait=True)


class ByHand:
    """What is written without a servo layer: the command from the tick at ``at``: "commanded", "q" or "q and v"."""

    def __init__(self, controller: Controller, kind: CommandKind, at: str) -> None:
        self.controller, self.kind, self.at = controller, kind, at
        self.robot = controller.stack.robot
        self.data = self.robot.model.createData()

    def reset(self, q: np.ndarray) -> None:
        """At rest."""
        self.controller.reset(q)
        self.q, self.v = q, np.zeros_like(q)

    def step(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The command's numbers."""
        start, before = self.q if self.at == "commanded" else q, self.v
        self.v = (self.controller.step(start, v) if self.at == "q and v" else self.controller.step(start)).v.copy()
        self.q = start + self.v * DT
        if self.kind is not CommandKind.TORQUE:
            return self.q if self.kind is CommandKind.POSITION else self.v
        back = 40.0 * (self.v - v) + 400.0 * (self.q - q) if self.at == "commanded" else 100.0 * (self.v - v)
        return np.asarray(pin.rnea(self.robot.model, self.data, q, v, (self.v - before) / DT + back) + v)


def error(follower: ByHand | Servo, kind: CommandKind) -> float:
    """Median distance of the hand from its path after half a second [mm]."""
    control = follower.controller
    robot = control.stack.robot
    plant = plant_of(kind, robot)
    plant.reset(HOME, 0.0)
    follower.reset(HOME)
    start, off = pin.SE3(control["hand"].target), []
    for k in range(TICKS):
        a = np.pi * k * DT
        goal = start.translation + [0.0, 0.15 * np.sin(a), 0.08 * np.sin(2 * a)]
        control["hand"].target = pin.SE3(start.rotation, goal)
        control["hand"].feedforward = [0.0, 0.15 * np.pi * np.cos(a), 0.16 * np.pi * np.cos(2 * a), 0.0, 0.0, 0.0]
        state = plant.read()
        if not state.valid:
            return np.inf
        if isinstance(follower, Servo):
            plant.apply(follower.step(state.q, state.v).command)
        else:
            plant.apply(Command(kind, follower.step(state.q, state.v)))
        plant.advance(DT)
        off.append(1e3 * float(np.linalg.norm(robot.pose(plant.read().q, "tool").translation - goal)))
    return float(np.median(off[SETTLED:]))


def parts() -> dict[str, Sheet | str]:
    """The plain servos by who follows."""
    control, rows = controller(), []
    for kind in KINDS:
        cells = [f"{error(ByHand(control, kind, at), kind):.2g}" for at in ("commanded", "q", "q and v")]
        untold = Servo(control, kind)
        cells.append(f"{error(untold, kind):.2g}")
        told = Servo(control, kind, response=untold.response)
        cells.append(f"{error(told, kind):.2g}")
        rows.append((str(kind), *cells))
    columns = ("hand off its path, median [mm]", "ticks at what was commanded", "at measured q", "at measured q and v",
               "`Servo`, told nothing", "`Servo`, told")  # fmt: skip
    return {"plain": Sheet("", columns, rows)}
