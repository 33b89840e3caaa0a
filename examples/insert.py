"""A peg goes into a hole of a table that moves: a program of steps (insert.yaml) relative to the hole, which is
measured 50 ms late and with noise.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin

import wbc
from wbc.estimation import PoseFilter, PoseStream, StreamState
from wbc.program import Program, Runner

DT, LATENCY, NOISE = 0.01, 0.05, 0.5e-3
robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=DT).add(wbc.tasks.MovingFrame(), name="hole")
stack.add(wbc.tasks.EndEffector("panda_hand_tcp", relative_to="hole", gain=20.0), name="peg")
stack.add(wbc.tasks.JointLimits())


def hole(t: float) -> pin.SE3:
    """Two inches along x at 0.1 Hz, 5 degrees of yaw at 0.05 Hz; z goes down into the table."""
    turn = np.radians(5.0) * np.sin(2.0 * np.pi * 0.05 * t)
    place = np.array([0.45 + 0.0508 * np.sin(2.0 * np.pi * 0.1 * t), 0.05, 0.35])
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])) @ np.diag([1.0, -1.0, -1.0]), place)


def insert(measured: bool) -> Runner:
    """Run the program; without measurements the hole is believed where it was at first."""
    rng, stream = np.random.default_rng(0), PoseStream(PoseFilter((NOISE, NOISE), (0.02, 0.02)))
    controller, q = stack.compile(), robot.neutral
    runner = Runner(Program.read(Path(__file__).with_suffix(".yaml")), controller)
    data, tip = robot.model.createData(), robot.model.getFrameId("panda_hand_tcp")
    for k in range(-100, 2000):
        t, error = k * DT, NOISE * rng.normal(size=6)
        true = hole(t - LATENCY)
        stream.push(t - LATENCY, pin.SE3(pin.exp3(error[3:]) @ true.rotation, true.translation + error[:3]))
        if k < 0:
            continue
        now = stream.at(t)
        if measured:
            controller["hole"].set(pose=now.pose, twist=now.twist, acceleration=now.acceleration)
        elif k == 0:
            controller["hole"].pose = now.pose
        pin.framesForwardKinematics(robot.model, data, q)
        x, y, depth = hole(t).actInv(data.oMf[tip]).translation
        signals = {"depth": depth, "aside": float(np.hypot(x, y)), "lost": float(now.state is StreamState.LOST)}
        if runner.tick(q, signals).state != "running":
            break
        q = pin.integrate(robot.model, q, controller.step(q).v * DT)
    return runner


if __name__ == "__main__":
    for measured in (False, True):
        runner = insert(measured)
        print(f"measured: {measured!s:5}  {runner.report.state} after {runner.time:.2f} s")
        for event in runner.log:
            if event.status != "begins":
                print(f"  {event.time:6.2f} s  {event.step:22} {event.status:7} {event.reason}")
