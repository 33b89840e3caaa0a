"""What an arm has that operators speak of: tip, elbow, pitch plane, in-plane rates, locks, other arms, a carrier."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
from wbc.coordinates.rows import Coordinate, PlaneAngleRows
from wbc.errors import WbcError
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD

#: Coordinates that are held together
Held: TypeAlias = tuple[Coordinate, ...]


class MissingPartError(WbcError):
    """What is asked for needs a part that a robot does not have; ``part`` is what it lacks."""

    part = ""

    @classmethod
    def of(cls, field: str, value: str, part: str, has: Iterable[str] = ()) -> MissingPartError:
        """The error about a part; ``has``: what the robot has of the kind."""
        error = cls(field, value, f"the robot has no {part}", has)
        error.part = part
        return error


@dataclass(frozen=True, eq=False)
class Arm:
    """One arm of a robot.

    Attributes:
        prefix: before the names of its joints and frames. joints: from its base on.
        tip: what its end effector has: a pose, or the position where it has no more joints than that.
        middle: a point on the way to the tip, or None. before_middle: joints that move that point.
        plane: rate alpha of the pitch plane, or angle psi of the plane of shoulder, elbow and wrist; None without one.
        in_plane: beta and gamma, as far as there are.
        sets: coordinates that are held while the tip is commanded, the default first; ``((),)`` where the tip takes
            all joints. with_middle: those that are held with the joints beyond while the middle point is commanded;
            with_both: with the tip, so that it has more rows than are left; None where self-motion does not move it.
        position_sets: those that are held while the tip's position is commanded, of a tip that has a pose.
    """

    prefix: str
    joints: tuple[str, ...]
    tip: BodyRows
    middle: BodyRows | None
    before_middle: int
    plane: PitchPlaneRows | PlaneAngleRows | None
    in_plane: Held
    sets: tuple[Held, ...]
    with_middle: Held
    with_both: Held | None
    position_sets: tuple[Held, ...]

    @property
    def redundancy(self) -> int:
        """Joints beyond the rows of the tip."""
        return len(self.joints) - len(self.tip.translation) - len(self.tip.rotation)

    @property
    def alpha(self) -> PitchPlaneRows | None:
        """The rate of the pitch plane, where the arm has parallel pitch axes."""
        return self.plane if isinstance(self.plane, PitchPlaneRows) else None

    def locks(self, first: int = 0) -> tuple[JointRows, ...]:
        """Locks of the joints from number ``first`` on."""
        return tuple(JointRows(name) for name in self.joints[validation.integer("first", first) :])

    def candidates(self) -> Held:
        """Coordinates of the sets, each once, the default first."""
        return tuple(dict.fromkeys(one for some in self.sets for one in some))

    def components(self) -> tuple[BodyRows, ...]:
        """The middle point's coordinates one by one."""
        return () if self.middle is None else components(self.middle)


def components(point: BodyRows) -> tuple[BodyRows, ...]:
    """The coordinates of a point one by one."""
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
        others: joints of none of these (fingers, a head, a base that drives): brakes hold them.
        free_body: coordinates of the first arm that are held where the body joint moves with it.
    """

    robot: Robot
    arms: tuple[Arm, ...]
    body: str | None = None
    carrier: Arm | None = None
    others: tuple[str, ...] = ()
    free_body: tuple[Held, ...] = ()

    @property
    def everything(self) -> tuple[Arm, ...]:
        """Arms and carrier."""
        return self.arms if self.carrier is None else (*self.arms, self.carrier)

    def brakes(self) -> tuple[JointRows, ...]:
        """Locks of the joints of no arm."""
        return tuple(JointRows(name) for name in self.others)
