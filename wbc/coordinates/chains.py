"""Arms of a tree as chains of joints without a branch, and the brakes of those that a pair does not command."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from wbc.analysis.rows import JointRows, PitchPlaneRows
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rows import Coordinate, PlaneAngleRows
from wbc.robot import Robot
from wbc.symbolic.kinematics import joint_of


def chains(robot: Robot) -> tuple[int, ...]:
    """The arm that each joint of the model belongs to, ``universe`` first, as the number of the arm's first joint."""
    parents = [int(parent) for parent in robot.model.parents]
    children = [parents[1:].count(j) for j in range(len(parents))]
    first = list(range(len(parents)))
    for j in range(1, len(parents)):
        if parents[j] > 0 and children[parents[j]] == 1:
            first[j] = first[parents[j]]
    return tuple(first)


def carrying_joint(robot: Robot, one: Coordinate) -> int:
    """Number of the joint that carries the body which a coordinate is of; 0: none does."""
    if isinstance(one, JointRows):
        return int(robot.model.getJointId(one.joint))
    frame = one.wrist if isinstance(one, (PitchPlaneRows, PlaneAngleRows)) else one.frame
    return joint_of(robot.model, frame)


@dataclass(frozen=True)
class Braked:
    """A pair without what brakes hold.

    Attributes:
        task, held: coordinates of task and of constraint. joints: names of those that the constraint locks on other
            arms than the task's: no rows are wanted of them, and no columns.
    """

    task: tuple[Coordinate, ...]
    held: tuple[Coordinate, ...]
    joints: tuple[str, ...]


def braked(robot: Robot, pair: CoordinatePair) -> Braked:
    """What is left of a pair where joints stand still that it locks on other arms than the task's."""
    first = chains(robot)
    led = {first[carrying_joint(robot, one)] for one in pair.task}
    still = [
        one for one in pair.constraint if isinstance(one, JointRows) and first[carrying_joint(robot, one)] not in led
    ]
    held = tuple(one for one in pair.constraint if one not in still)
    return Braked(pair.task, held, tuple(one.joint for one in still))


def free_joints(robot: Robot, brakes: Iterable[str]) -> list[int]:
    """Numbers of the velocities that joints with brakes leave.

    Raises:
        UnknownNameError: no such joint.
    """
    still = {k for name in brakes for k in range(robot.nv)[robot.dofs(name, "brakes")]}
    return [k for k in range(robot.nv) if k not in still]
