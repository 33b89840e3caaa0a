"""What an arm has that operators speak of: tip, elbow, pitch plane, in-plane rates, locks, other arms, a carrier."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
from wbc.coordinates.rows import Coordinate
from wbc.robot import Robot
from wbc.robots import operator_arm
from wbc.robots.operator_arms import OPERATOR_ARMS
from wbc.symbolic.kinematics import WORLD


@dataclass(frozen=True, eq=False)
class Arm:
    """One arm of a robot.

    Attributes:
        prefix: before the names of its joints and frames. joints: from its base on.
        tip: what its end effector has: a pose, or the position where it has no more joints than that.
        middle: a point on the way to the tip, or None. before_middle: joints that move that point.
        alpha: rate of the pitch plane. in_plane: beta and gamma, as far as there are.
    """

    prefix: str
    joints: tuple[str, ...]
    tip: BodyRows
    middle: BodyRows | None
    before_middle: int
    alpha: PitchPlaneRows | None
    in_plane: tuple[BodyRows, ...]

    @property
    def redundancy(self) -> int:
        """Joints beyond the rows of the tip."""
        return len(self.joints) - len(self.tip.translation) - len(self.tip.rotation)

    def locks(self, first: int = 0) -> tuple[JointRows, ...]:
        """Locks of the joints from number ``first`` on."""
        return tuple(JointRows(name) for name in self.joints[first:])

    def candidates(self) -> tuple[Coordinate, ...]:
        """Single coordinates that can take the redundancy up, the default first: pitch plane, beta, gamma, locks of
        the first two joints and the last one, components of the middle point.
        """
        out: list[Coordinate] = [] if self.alpha is None else [self.alpha]
        out += self.in_plane
        if self.alpha is not None:
            ends = (0, 1) if len(self.joints) < 7 else (0, 1, 6)
            out += [JointRows(self.joints[k]) for k in ends]
        return (*out, *self.components())

    def components(self) -> tuple[BodyRows, ...]:
        """The middle point's coordinates one by one."""
        point = self.middle
        if point is None:
            return ()
        axes = point.expressed or WORLD
        return tuple(
            BodyRows(point.frame, expressed=axes, translation=(k,), rotation=(), name=f"{point.name} {'xyz'[k]}")
            for k in point.translation
        )


@dataclass(frozen=True, eq=False)
class Parts:
    """A robot and its parts.

    Attributes:
        robot: with all frames that the rows need. arms: those that work; the first one is commanded by default.
        body: joint of the body that carries two arms, or None. carrier: the arm that carries everything, or None.
    """

    robot: Robot
    arms: tuple[Arm, ...]
    body: str | None = None
    carrier: Arm | None = None

    @property
    def everything(self) -> tuple[Arm, ...]:
        """Arms and carrier."""
        return self.arms if self.carrier is None else (*self.arms, self.carrier)


@cache
def parts(name: str) -> Parts:
    """Parts of a robot of :func:`wbc.robots.operator_arm`.

    Raises:
        UnknownNameError: no such arm.
    """
    validation.one_of("robot", name, OPERATOR_ARMS)
    robot = operator_arm(name).robot
    if name == "spdm":
        return Parts(robot, (_seven("arm1_", 2), _seven("arm2_", 2)), "body_joint")
    if name == "spdm_on_ssrms":
        return Parts(robot, (_seven("arm1_", 2), _seven("arm2_", 2)), "body_joint", _seven("carrier_", 1))
    if name == "planar_rp":
        tip = BodyRows("tip", expressed=WORLD, translation=(0, 1), rotation=(), name="tip")
        middle = BodyRows("end1", expressed=WORLD, translation=(0, 1), rotation=(), name="end of link 1")
        return Parts(robot, (Arm("", ("joint1", "joint2"), tip, middle, 1, None, ()),))
    if name == "planar_3r":
        tip = BodyRows("tip", expressed=WORLD, translation=(0, 1), rotation=(), name="tip")
        robot = _with_middle(robot)
        middle = BodyRows("middle", expressed=WORLD, translation=(0, 1), rotation=(), name="middle")
        return Parts(robot, (Arm("", ("joint1", "joint2", "joint3"), tip, middle, 2, None, ()),))
    if name == "spherical_4r":
        tip = BodyRows("tip", rotation=(), name="tip")
        elbow = BodyRows("end3", rotation=(), name="elbow")
        joints = tuple(f"joint{k}" for k in range(1, 5))
        return Parts(robot, (Arm("", joints, tip, elbow, 3, PitchPlaneRows("F3", "tip"), (_beta("", 1),)),))
    return Parts(robot, (_seven("", 2 if name.startswith("spdm") else 1),))


def _with_middle(robot: Robot) -> Robot:
    """The planar arm with the middle of its second link."""
    return robot.with_frame("middle", "F2", pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0])))


def _beta(prefix: str, pitch: int) -> BodyRows:
    return BodyRows(f"{prefix}F2", expressed=f"{prefix}F3", translation=(), rotation=(pitch,), name=f"{prefix}beta")


def _seven(prefix: str, pitch: int) -> Arm:
    """An arm with seven joints; ``pitch``: axis of its frames about which the pitch joints turn."""
    gamma = BodyRows(f"{prefix}F6", expressed=f"{prefix}F5", translation=(), rotation=(pitch,), name=f"{prefix}gamma")
    return Arm(
        prefix,
        tuple(f"{prefix}joint{k}" for k in range(1, 8)),
        BodyRows(f"{prefix}tip", name=f"{prefix}xi"),
        BodyRows(f"{prefix}end3", rotation=(), name=f"{prefix}elbow"),
        3,
        PitchPlaneRows(f"{prefix}F3", f"{prefix}F5", name=f"{prefix}alpha"),
        (_beta(prefix, pitch), gamma),
    )
