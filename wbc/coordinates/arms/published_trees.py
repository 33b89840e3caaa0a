"""Sets of coordinates for whole trees: both hands of the dexterous manipulator, alone and on the Station arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows, Rows
from wbc.coordinates.arms.arm_parts import Arm
from wbc.coordinates.arms.which_parts import parts
from wbc.robot import Robot

#: Robots that have sets of the whole tree
TREES = ("spdm", "spdm_on_ssrms")


@dataclass(frozen=True)
class TreeSet:
    """The rows of a task, and those of the constraints that go with it."""

    task: tuple[Rows, ...]
    constraints: tuple[Rows, ...]


@dataclass(frozen=True, eq=False)
class TreeSets:
    """A tree of arms with its sets.

    Attributes:
        robot: with all frames that the rows need.
        sets: by name, the default of ``wbc coordinates analyse`` in this order.
    """

    robot: Robot
    sets: Mapping[str, TreeSet]


def tree_sets(name: str) -> TreeSets:
    """Sets of a tree: the poses of both hands as the task, alpha, q1, q7 and elbow of each arm, the body's lock, and

        spdm_on_ssrms: the carrier's tip, as a constraint or in the task, with the coordinates that name the set

    "arms alpha" has alone the pitch plane of each arm, and of the carrier elbow, beta and gamma: 26 rows of 22 joints.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 4.5, eqs. 4.46 to 4.48; "elbow, q1, q2, q7" is new.

    Raises:
        UnknownNameError: no such tree.
    """
    return _tree_sets(validation.one_of("robot", name, TREES))


@cache
def _tree_sets(name: str) -> TreeSets:
    whole = parts(name)
    assert whole.body is not None
    hands, body = tuple(arm.tip for arm in whole.arms), JointRows(whole.body)
    planes = (*(_part(arm, "alpha") for arm in whole.arms), body)
    full = (*(_part(arm, c) for arm in whole.arms for c in ("alpha", "q1", "q7", "elbow")), body)
    carrier = whole.carrier
    if carrier is None:
        return TreeSets(whole.robot, {"alpha, q1, q7, elbow": TreeSet(hands, full), "alpha": TreeSet(hands, planes)})
    in_plane = tuple(_part(carrier, c) for c in ("elbow", "beta", "gamma"))
    locks = tuple(_part(carrier, c) for c in ("elbow", "q1", "q2", "q7"))
    sets = {
        "elbow, beta, gamma": TreeSet(hands, (*full, carrier.tip, *in_plane)),
        "elbow, beta, gamma, tip in task": TreeSet((*hands, carrier.tip), (*full, *in_plane)),
        "elbow, q1, q2, q7": TreeSet(hands, (*full, carrier.tip, *locks)),
        "arms alpha": TreeSet(hands, (*planes, carrier.tip, *in_plane)),
    }
    return TreeSets(whole.robot, sets)


def _part(arm: Arm, name: str) -> Rows:
    """A coordinate of an arm by the name it has in sets."""
    if name.startswith("q"):
        return JointRows(arm.joints[int(name[1:]) - 1], name=f"{arm.prefix}{name}")
    if name == "alpha" and arm.alpha is not None:
        return arm.alpha
    if name == "elbow" and arm.middle is not None:
        return arm.middle
    found = arm.in_plane[("beta", "gamma").index(name)]
    assert isinstance(found, BodyRows)
    return found
