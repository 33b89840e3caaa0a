"""TALOS crosses its arms: on their straight ways hands and forearms would run into each other."""

import itertools

import numpy as np
import pinocchio as pin

import wbc
from wbc.track import Scene, self_clearances

# Both arms only: a capsule fitted round each link from the elbow on and round the chest, a ball round each gripper
robot = wbc.robots.load("talos", base="fixed", lock=["leg_*", "torso_*", "head_*", "gripper_*"], shapes="none")
hands = {side: robot.frames[f"{side}_hand"] for side in ("left", "right")}
arms = {side: [f"arm_{side}_{k}_link" for k in (4, 5, 7)] for side in hands}
robot = wbc.robots.fit_shapes(robot, [*arms["left"], *arms["right"], "torso_2_link"])
ball = wbc.shapes.PlacedShape(wbc.shapes.Sphere(0.12), pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.07])))
robot = robot.with_shapes({**robot.shapes, **{hand: [ball] for hand in hands.values()}})
left, right = ([*arms[side], hands[side]] for side in hands)
# The elbow is always next to the chest, so it is no pair with it
pairs = [*itertools.product(left, right), *((link, "torso_2_link") for link in left[1:] + right[1:])]

stack = wbc.Stack(robot, dt=0.02)
for side, hand in hands.items():
    stack.add(wbc.tasks.EndEffector(hand, kind="position", gain=5.0), name=side)
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits())
stack.add(wbc.tasks.SelfCollision(pairs, margin=0.02), name="apart")
controller = stack.compile()

# In front of its own shoulder, and then on the other side
places = {"left": ([0.4, 0.3, 0.1], [0.45, -0.15, 0.25]), "right": ([0.4, -0.3, 0.1], [0.45, 0.15, 0.15])}


def crossed(apart: bool) -> np.ndarray:
    """The postures of a run: 2 s to get ready, 3 s in which the targets cross on straight lines, 2 s to arrive."""
    q, postures = robot.neutral, []
    controller.reset(q)
    controller["apart"].enabled = apart
    for k in range(350):
        for side, (first, last) in places.items():
            share = min(max((k - 100) / 150, 0.0), 1.0)
            controller[side].target = (1.0 - share) * np.array(first) + share * np.array(last)
        step = controller.step(q)
        q = robot.integrate(q, step.v, stack.dt)
        postures.append(q)
    # Measured by Coal, whether the controller looked at these pairs or not
    least = min(gap.min() for gap in self_clearances(robot, np.array(postures), pairs).values())
    off = max(step.residuals[side].norm("m") for side in hands)
    print(f"{'with' if apart else 'without'} SelfCollision: least distance {1e3 * least:.1f} mm")
    print(f"  at the end: {step.status}, hands at most {1e3 * off:.1f} mm from their targets")
    return np.array(postures)


def trail(postures: np.ndarray, frame: str) -> np.ndarray:
    """Way of a frame from where the targets start to cross [m]."""
    points = []
    for q in postures[100:]:
        points.append(robot.pose(q, frame).translation)
    return np.array(points)


through, around = crossed(False), crossed(True)
scene = Scene(robot, dark=list(hands.values()), detail=0.005, hidden=["leg_*"])
scene.add_robot(around[185])
for hand in hands.values():
    scene.add_path(trail(through, hand), "hands without SelfCollision", (0.86, 0.27, 0.22))
    scene.add_path(trail(around, hand), "hands with SelfCollision", radius=0.008)
print(scene.save("runs/self_collision.png", size=(760, 510), azimuth=0.1, elevation=0.35))
