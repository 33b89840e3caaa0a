"""``wbc track``: one robot, one path, one folder of results."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from wbc.cli.output import TRACKED, TrackOutput
from wbc.cli.scene import Backend, Plane, SceneOptions

#: Period of torques, about [s]
TORQUES = 0.001
#: Where the demo goes to
DEMO = TrackOutput(Path("runs/demo"), force=True)
Solver = Annotated[str, "QP solver: daqp, or another that is installed."]
Rate = Annotated[float, "Ticks a second [Hz]."]


@dataclass(frozen=True)
class Track(SceneOptions):
    """Follow a timed Cartesian path, and leave a log, plots and a summary.

    Ctrl-C ends the run early; what was done until then is written all the same.
    """

    PANEL: ClassVar[str] = "How it follows"
    path: Annotated[str, "circle, figure-eight, line or around-obstacle, or a CSV, JSON or TOML file of waypoints."] = (
        "circle"
    )
    duration: Annotated[float | None, "Of the path [s]. Default: 6, or the file's own; a file is stretched."] = None
    size: Annotated[float | None, "Of a preset [m]. Default: the preset's."] = None
    plane: Annotated[Plane, "Elbow plane; auto holds it if more than six joints move."] = "auto"
    swing: Annotated[float, "Amplitude of --plane swing [rad]."] = 0.5
    rate: Rate = 200.0
    plant: Annotated[
        Literal["kinematic", "pinocchio", "mujoco"],
        "What moves: joints that do as commanded, or drives that give torques.",
    ] = "kinematic"
    solver: Solver = "daqp"
    kind: Annotated[Literal["pose", "position"], "What follows the path."] = "pose"
    gain: Annotated[float, "Gain of the hand [1/s]."] = 10.0
    output: Annotated[TrackOutput, "What it writes"] = TRACKED

    def run(self) -> int:
        from wbc.cli.session import perform
        from wbc.simulation import driven

        plan = self.planned(self.path, self.duration, self.size, (self.plane, self.swing), self.rate)
        plan = replace(plan, gain=self.gain, kind=self.kind, solver=self.solver)
        period = plan.dt / max(round(plan.dt / TORQUES), 1)
        return perform(plan, self.output, driven(self.plant, plan.robot, period))


@dataclass(frozen=True)
class Demo:
    """Have a Panda go round an obstacle with its elbow plane commanded."""

    duration: Annotated[float, "Of the path [s]."] = 12.0
    rate: Rate = 200.0
    solver: Solver = "daqp"
    backend: Backend = "auto"
    output: Annotated[TrackOutput, "What it writes"] = DEMO

    def run(self) -> int:
        from wbc.cli.session import perform
        from wbc.track.demo import demo

        return perform(demo(self.duration, self.rate, self.solver, self.backend), self.output)
