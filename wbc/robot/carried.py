"""An object in a hand: a shape and a mass on a frame, as if it were a link of the robot."""

from __future__ import annotations

from typing import Any

from wbc import validation
from wbc.errors import DuplicateNameError, RangeError
from wbc.multibody import pin
from wbc.robot.pairs.collision_pairs import find_self_pairs
from wbc.robot.robot import Robot, changed, checked_robot
from wbc.shapes import PlacedShape, Solid
from wbc.symbolic.kinematics import frame_index, joint_of


def carry(
    robot: Robot,
    name: str,
    frame: str,
    shape: Solid,
    *,
    placement: Any = None,
    mass: float = 0.0,
    inertia: pin.Inertia | None = None,
) -> Robot:
    """A copy of a robot that has an object in its hand: a frame with a shape and a mass, fixed to a frame.

    What guards links guards the object too: ``Obstacle`` (all links, or ``links=("box",)``) and ``SelfCollision``,
    whose pairs get the object with every link that it does not touch in the neutral configuration and that is not on
    the same joint. Tasks of the centre of mass and stacks that command torques count its mass.

        holding = wbc.robots.carry(robot, "box", "panda_hand_tcp", wbc.shapes.Box((0.1, 0.1, 0.2)), mass=1.5)

    Put down is the robot that was there before. In one controller of ``holding``, a guard of the object alone is
    switched off while the hand is empty: ``controller["box guard"].enabled = False``; its mass cannot be.

    Args:
        robot: the robot, unchanged. name: of the object's frame, at the shape's own origin.
        frame: that carries it. shape: see :mod:`wbc.shapes`. placement: of the object in ``frame``; default: identity.
        mass: [kg], spread evenly over the shape. inertia: in place of ``mass``, in the object's frame; for a
            ``Convex``, whose own is not computed.

    Raises:
        UnknownNameError, DuplicateNameError: the frames. ShapeError, RangeError, NotFiniteError, RotationError: no
            shape, placement or mass; an object on the world, which is an obstacle.
    """
    checked_robot(robot)
    if joint_of(robot.tree, robot.check_frame("frame", frame)) == 0:
        raise RangeError("frame", frame, "it does not move: what stands there is an Obstacle")
    if name in robot.frame_names:
        raise DuplicateNameError("name", name, "a frame of this name exists")
    placed = PlacedShape(shape, pin.SE3.Identity())
    weighs = (
        _inertia(shape, mass) if inertia is None else validation.instance("inertia", inertia, pin.Inertia, "inertia")
    )
    out = robot.with_frame(name, frame, placement)
    model = pin.Model(out.model)
    at = model.frames[frame_index(model, name)]
    joint = int(at.parentJoint)
    model.appendBodyToJoint(joint, weighs, at.placement)
    shaped = changed(out, model=model).with_shapes({**robot.shapes, name: (placed,)})
    if robot.self_pairs is None:
        return shaped
    found = find_self_pairs(shaped, samples=0).kept
    fixed = {link for link in shaped.shapes if joint_of(shaped.tree, link) == joint}
    new = [pair for pair in found if name in pair and not set(pair) <= fixed]
    return changed(shaped, self_pairs=(*robot.self_pairs, *new))


def _inertia(shape: Solid, mass: float) -> pin.Inertia:
    m = validation.scalar("mass", mass, low=0.0, unit="kg")
    if m == 0.0:
        return pin.Inertia.Zero()
    return shape.inertia(m)
