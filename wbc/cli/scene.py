"""What commands on a robot among obstacles share: their options, and the plan that these make."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from wbc.cli import completion
from wbc.cli.reading import Option, numbers
from wbc.errors import ShapeError, WbcError

if TYPE_CHECKING:
    from wbc.robot import Robot
    from wbc.track.setup import MovingObstacle, PathRun
    from wbc.validation import Array

RobotName = Annotated[
    str, Option("A name of `wbc robots`, or a URDF or MJCF file.", placed=True, complete=completion.robots)
]
FrameName = Annotated[str | None, Option("Frame that moves. Default: the robot's tip.", complete=completion.frames)]
Backend = Annotated[Literal["auto", "native", "vm"], "How ticks are compiled."]
Force = Annotated[bool, "Write over what is there."]
Plane = Literal["auto", "off", "hold", "swing"]


@dataclass(frozen=True)
class SceneOptions:
    """A robot among obstacles."""

    PANEL: ClassVar[str] = "What it does"
    robot: RobotName = "panda"
    frame: FrameName = None
    start: Annotated[str | None, "First configuration, numbers with commas [rad, m]. Default: neutral."] = None
    sphere: Annotated[tuple[str, ...], "Obstacle X,Y,Z,RADIUS[,VX,VY,VZ] [m, m/s]; may be repeated."] = ()
    floor: Annotated[float | None, "Height of a floor that links stay above [m]."] = None
    hold: Annotated[tuple[str, ...], "Frame that must not move; default: feet of a floating robot."] = ()
    margin: Annotated[float, "Distance kept from obstacles [m]."] = 0.02
    backend: Backend = "auto"

    def obstacles(self) -> dict[str, MovingObstacle]:
        """By name.

        Raises:
            ShapeError, RangeError, NotFiniteError: a sphere or a floor that is none.
        """
        import numpy as np

        from wbc import shapes, validation
        from wbc.multibody import pin
        from wbc.track.setup import MovingObstacle

        found = {}
        for k, text in enumerate(self.sphere, 1):
            given = numbers("sphere", text)
            if len(given) not in (4, 7):
                raise ShapeError("sphere", text, "expected X,Y,Z,RADIUS or X,Y,Z,RADIUS,VX,VY,VZ")
            velocity = given[4:] if len(given) == 7 else np.zeros(3)
            place = pin.SE3(np.eye(3), given[:3])
            found[f"sphere{k}"] = MovingObstacle(shapes.Sphere(float(given[3])), place, velocity)
        if self.floor is not None:
            height = validation.scalar("floor", self.floor, unit="m")
            found["floor"] = MovingObstacle(shapes.HalfSpace(), pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
        return found

    def planned(
        self,
        path: str = "circle",
        duration: float | None = None,
        size: float | None = None,
        plane: tuple[str, float] = ("off", 0.0),
        rate: float = 200.0,
    ) -> PathRun:
        """The plan that options mean. A plan has a path, on which its stack does not depend.

        Args:
            path: preset or file. duration: of it [s]. size: of a preset [m].
            plane: what to do with the elbow plane, and the amplitude of its swing [rad].
            rate: commands a second.

        Raises:
            WbcError: an option that is not valid.
        """
        from wbc import robots, validation
        from wbc.track.plans import feet, followed, plane_command
        from wbc.track.setup import PathRun

        obstacles = self.obstacles()
        machine = robots.load(self.robot)
        frequency = validation.scalar("rate", rate, low=0.0, open_low=True, unit="Hz")
        tip = tip_frame(machine, self.frame)
        first = configuration(machine, "start", self.start)
        timed, own, label = followed(machine, tip, first, path, duration, size)
        return PathRun(
            machine,
            tip,
            timed,
            label,
            first,
            dt=1.0 / frequency,
            obstacles=own | obstacles,
            plane=plane_command(machine, *plane),
            holds=self.hold or feet(machine),
            margin=self.margin,
            backend=self.backend,
        )


def tip_frame(robot: Robot, frame: str | None) -> str:
    """The frame to move: the one that is named, else the tip or hand that the table knows, else, where the robot is one
    chain of joints, the last frame on its last joint.

    Raises:
        UnknownNameError: no such frame. WbcError: none of these.
    """
    if frame is not None:
        return robot.check_frame("frame", frame)
    for role in ("tip", "right_hand", "left_hand"):
        if role in robot.frames:
            return robot.frames[role]
    tree, last = robot.tree, robot.tree.njoints - 1
    if last > 0 and all(tree.parents[j] == j - 1 for j in range(1, last + 1)):
        return [str(each.name) for each in tree.frames if each.parentJoint == last][-1]
    raise WbcError("frame", None, f"the table knows no tip of {robot.name}; choose with --frame", robot.frame_names[1:])


def configuration(robot: Robot, field: str, text: str | None) -> Array:
    """A configuration from numbers with commas, one a coordinate; the neutral one for no text."""
    return robot.configuration(field, numbers(field, text)) if text else robot.neutral
