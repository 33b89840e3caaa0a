"""A Panda reaches through clutter: a house, a box, a post and a bar stand in its way, and a ball flies through it."""

import itertools

import numpy as np
import pinocchio as pin

import wbc
from wbc.shapes import Box, Capsule, Convex, Cylinder, Sphere
from wbc.track import MovingObstacle, Scene, clearances


def at(x: float, y: float, z: float, roll: float = 0.0) -> pin.SE3:
    """A place [m], turned about x [rad]."""
    return pin.SE3(pin.utils.rotate("x", roll), np.array([x, y, z]))


# A mesh is the list of its convex parts: here walls and roof
walls = Convex(np.array(list(itertools.product((-0.1, 0.1), (-0.1, 0.1), (0.0, 0.2)))))
roof = Convex(np.array([[x, y, 0.32 if y == 0 else 0.2] for x in (-0.12, 0.12) for y in (-0.12, 0.0, 0.12)]))
flight = np.array([0.0, -0.25, 0.0])
clutter = {
    "house": [MovingObstacle(part, at(0.55, 0.0, 0.0)) for part in (walls, roof)],
    "box": [MovingObstacle(Box((0.25, 0.3, 0.3)), at(0.55, 0.45, 0.15))],
    "post": [MovingObstacle(Cylinder(0.04, 0.5), at(0.3, 0.25, 0.25))],
    "bar": [MovingObstacle(Capsule(0.03, 0.6), at(0.55, 0.0, 0.72, np.pi / 2))],
    "ball": [MovingObstacle(Sphere(0.08), at(0.3, 1.0, 0.62), flight)],
}

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.02)
stack.add(wbc.tasks.EndEffector(robot.frames["tip"], kind="position", gain=5.0), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
for name, parts in clutter.items():
    shape = parts[0].shape if len(parts) == 1 else [part.shape for part in parts]
    stack.add(wbc.tasks.Obstacle(shape, margin=0.015, pose=parts[0].pose), name=name)
controller = stack.compile()
controller["ball"].velocity = [*flight, 0.0, 0.0, 0.0]

q, first, last = robot.neutral, np.array([0.5, -0.45, 0.4]), np.array([0.5, 0.45, 0.4])
times = stack.dt * np.arange(400)
postures, hand = [], []
for t in times:
    hand.append(robot.pose(q, robot.frames["tip"]).translation)
    postures.append(q)
    share = min(max((t - 1.0) / 4.0, 0.0), 1.0)
    controller["hand"].target = (1.0 - share) * first + share * last
    controller["ball"].pose = clutter["ball"][0].at(t)
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)

# Coal measures every part of the clutter against all links, whatever the controller looked at
for name, parts in clutter.items():
    gaps = clearances(robot, np.array(postures), {str(k): part for k, part in enumerate(parts)}, times)
    link = min(gaps, key=lambda name: gaps[name].min())
    print(f"{name}: {link} came within {1e3 * gaps[link].min():.1f} mm at {times[gaps[link].argmin()]:.2f} s")
print(f"at the end: {step.status}, hand {1e3 * np.linalg.norm(hand[-1] - last):.2f} mm from its target")

scene = Scene(robot, dark=["panda_hand"], detail=0.003)
for k, pale in ((175, False), (50, True), (399, True)):
    scene.add_robot(postures[k], pale=pale)
for part in itertools.chain(*clutter.values()):
    moves = bool(part.velocity.any())
    label, colour = ("moves", (0.86, 0.27, 0.22)) if moves else ("stands still", (0.80, 0.66, 0.45))
    scene.add_shape(part.shape, part.at(times[175]), label, colour)
scene.add_path(np.array(hand)[50:], "path of the hand")
print(scene.save("runs/clutter.png", size=(800, 540)))
