"""A hand keeps its place over a table that heaves and turns, measured late and with noise."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.estimation import PoseFilter, PoseStream

DT, LATENCY, NOISE = 0.01, 0.05, 0.5e-3
robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=DT).add(wbc.tasks.MovingFrame(), name="table")
stack.add(wbc.tasks.EndEffector("panda_hand_tcp", relative_to="table", gain=20.0), name="hand")
stack.add(wbc.tasks.Obstacle(wbc.shapes.Box((0.6, 0.6, 0.02)), margin=0.02), name="top", relative_to="table")
stack.add(wbc.tasks.JointLimits())


def table(t: float) -> pin.SE3:
    """Two inches along x at 0.1 Hz, 5 degrees of yaw at 0.05 Hz."""
    turn = np.radians(5.0) * np.sin(2.0 * np.pi * 0.05 * t)
    place = np.array([0.45 + 0.0508 * np.sin(2.0 * np.pi * 0.1 * t), 0.0, 0.15])
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), place)


def follow(compensated: bool) -> float:
    """Largest error of the hand in the table's frame [m], of 10 s."""
    rng, stream = np.random.default_rng(0), PoseStream(PoseFilter((NOISE, NOISE), (0.01, 0.01)))
    controller, q = stack.compile(), robot.neutral
    data, tip, places = robot.model.createData(), robot.model.getFrameId("panda_hand_tcp"), []
    for k in range(-100, 1000):
        t = k * DT
        error = NOISE * rng.normal(size=6)
        true = table(t - LATENCY)
        stream.push(t - LATENCY, pin.SE3(pin.exp3(error[3:]) @ true.rotation, true.translation + error[:3]))
        if k < 0:
            continue
        now = stream.at(t)
        if k == 0 or compensated:
            controller["table"].pose = now.pose
        if compensated:
            controller["table"].set(twist=now.twist, acceleration=now.acceleration)
        pin.framesForwardKinematics(robot.model, data, q)
        places.append(table(t).actInv(data.oMf[tip]).translation)
        q = pin.integrate(robot.model, q, controller.step(q).v * DT)
    return float(np.linalg.norm(np.array(places) - places[0], axis=1).max())


if __name__ == "__main__":
    for compensated in (False, True):
        print(f"compensated: {compensated!s:5}  largest error in the table's frame {1e3 * follow(compensated):.2f} mm")
