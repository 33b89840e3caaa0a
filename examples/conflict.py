"""Three conflicts on a Panda and who is to blame: the controller names the culprits, in their units."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.shapes import Sphere

robot = wbc.robots.load("panda")
tip = robot.frames["tip"]
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector(tip, kind="position"), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits(), name="limits")
stack.add(wbc.tasks.Hold(tip, kind="position"), name="grip")
stack.add(wbc.tasks.Obstacle(Sphere(0.08), links=("panda_hand",)), name="ball")
controller = stack.compile()

q, still = robot.neutral, np.zeros(robot.nv)
place = robot.pose(q, tip).translation


def at(offset: list[float]) -> pin.SE3:
    """A place beside the hand [m]."""
    return pin.SE3(np.eye(3), place + offset)


def fresh(*on: str) -> None:
    """At rest, with nothing wanted; only these constraints are on besides the limits."""
    controller.reset(q, still)
    controller["ball"].pose, controller["ball"].velocity = at([0.0, 0.0, 5.0]), np.zeros(6)
    for name in ("grip", "ball"):
        controller[name].enabled = name in on
    controller["hand"].gain, controller["hand"].target = 2.0, place
    controller["grip"].target = at([0.0, 0.0, 0.0])


print("1. The hand holds on to something, and a ball flies at it")
fresh("grip", "ball")
controller["ball"].pose = at([0.25, 0.0, 0.05])
controller["ball"].velocity = [-3.0, 0.0, 0.0, 0.0, 0.0, 0.0]
print(controller.step(q, still).explain())

print("\n2. What the hand holds is carried away faster than the joints can follow")
fresh("grip")
controller["grip"].target, controller["grip"].gain = at([0.0, 0.03, 0.0]), 20.0
print(controller.step(q, still).explain())

print("\n3. Nothing contradicts, but the joints may only move at a hundredth of their speed")
fresh()
controller["limits"].velocity_scale = 0.01
controller["hand"].target = place + [0.0, 0.05, 0.0]
explanation = controller.step(q, still).explain()
print(explanation)

loss = next(loss for loss in explanation.losses if loss.task == "hand")
price = max((price for price in explanation.prices if price.task == "hand"), key=lambda price: price.amount)
print(f"\nThe culprit: {loss.to[0].item} takes {1e3 * loss.to[0].amount:.1f} mm/s from the hand, most of all {price}")
