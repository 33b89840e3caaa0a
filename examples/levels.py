"""A hand that moves, an elbow below it, a posture below both: what strict levels guarantee and weights do not.

The elbow is asked to go where the hand does not allow it. With levels the hand's speed is what it is without an
elbow task, to rounding. With weights the elbow costs the hand, and the posture costs both.
"""

import numpy as np
import pinocchio as pin

import wbc

ROBOT = wbc.robots.load("panda")
START = np.array([0.1, -0.4, 0.2, -2.0, 0.1, 1.6, 0.7])
GOAL = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), np.array([0.4, 0.3, 0.3]))
DT = 0.005


def stack(strict: bool) -> wbc.Stack:
    """Three wishes, by level or by weight."""
    out = wbc.Stack(ROBOT, dt=DT)
    out.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    out.add(wbc.tasks.Elbow("panda_link4"), name="elbow", level=1 if strict else 0, weight=1.0 if strict else 0.1)
    out.add(wbc.tasks.Posture(), name="posture", level=2 if strict else 0, weight=1.0 if strict else 1e-2)
    return out.add(wbc.tasks.JointLimits())


def run(strict: bool) -> float:
    """Three seconds; the hand's error at the end [m]."""
    controller = stack(strict).compile()
    controller.reset(START)
    controller["hand"].target = GOAL
    controller["elbow"].target = [0.0, -0.4, 0.5]
    q = START
    for _ in range(600):
        step = controller.step(q)
        q = ROBOT.integrate(q, step.v, DT)
    print(f"{'levels' if strict else 'weights'}: {step}")
    for level in step.levels:
        text = f"  level {level.level}: takes {level.rank}, leaves {level.free}, disturbed {level.disturbance:.1e}"
        print(text + "".join(f", dropped {row}" for row in level.dropped[:1]))
    return step.residuals["hand"].norm("m")


if __name__ == "__main__":
    strict, weighted = run(strict=True), run(strict=False)
    print(f"hand after 3 s: {1e3 * strict:.2f} mm off with levels, {1e3 * weighted:.2f} mm off with weights")
