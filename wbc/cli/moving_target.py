"""``wbc moving-target``: a peg into a hole, or a hand onto a fixture, of an object that moves."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from math import degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from wbc.cli.scene import Backend, Force, FrameName, RobotName

if TYPE_CHECKING:
    from wbc.moving_target.knowledge import Knowledge
    from wbc.moving_target.study import Outcome
    from wbc.moving_target.trial import TargetTrial

Known = Literal["none", "pose", "twist", "late", "estimated"]


@dataclass(frozen=True)
class SensingOptions:
    """What is known of the object."""

    PANEL: ClassVar[str] = "What is known of the object"
    knowledge: Annotated[tuple[Known, ...], "May be repeated. Default: all."] = ()
    noise: Annotated[float, "Standard deviation of measured positions [m]."] = 0.5e-3
    turn: Annotated[float, "The same of measured rotations [rad]."] = 0.5e-3
    latency: Annotated[float, "Age of a measurement when it arrives [s]."] = 0.05
    dropouts: Annotated[float, "How often measurements stop for 0.2 s [1/s]."] = 0.0


@dataclass(frozen=True)
class MovingTarget(SensingOptions):
    """Work on an object that moves, compensated or not.

    Leaves figures, plots and a film. Ctrl-C ends the trials early; those that were done are written all the same.

    Example: wbc moving-target --motion tumble --runs 50
    """

    PANEL: ClassVar[str] = "What it does"
    robot: RobotName = "panda"
    frame: FrameName = None
    job: Annotated[Literal["peg", "grasp"], "A peg into a hole of a table, or a fixture of a free body."] = "peg"
    motion: Annotated[Literal["sea", "tumble", "swing", "rest"], "swing: 2 in at 0.1 Hz, 5 degrees at 0.05 Hz."] = "sea"
    runs: Annotated[int, "Random trials with each knowledge."] = 20
    severity: Annotated[float, "What the motion's heights and rates are multiplied by [1]."] = 1.0
    clearance: Annotated[float, "Between peg and hole, all round [m]."] = 1.5e-3
    backend: Backend = "auto"
    film: Annotated[bool, "Draw the film."] = True
    out: Annotated[Path | None, "Run folder. Default: runs/moving-JOB-MOTION-TIME."] = None
    force: Force = False

    def run(self) -> int:
        from wbc import robots, validation
        from wbc.cli.console import out, progress_bar, say, table, tell
        from wbc.cli.folders import filled, run_folder
        from wbc.cli.scene import tip_frame
        from wbc.cli.session import INTERRUPTED, Stopper
        from wbc.moving_target import folder as files, pictures
        from wbc.moving_target.knowledge import Knowledge, Measurement
        from wbc.moving_target.study import grasp, outcome, peg, trials

        kinds = [Knowledge(one) for one in self.knowledge] or list(Knowledge)
        for name in ("noise", "turn", "latency", "dropouts", "severity"):
            validation.scalar(name, getattr(self, name), low=0.0)
        validation.scalar("clearance", self.clearance, low=0.0, open_low=True, unit="m")
        runs = validation.integer("runs", self.runs, 1)
        machine = robots.load(self.robot)
        tip = tip_frame(machine, self.frame)
        sensor = Measurement((self.noise, self.turn), self.latency, dropouts=self.dropouts)
        if self.job == "peg":
            study = peg(machine, tip, self.motion, self.clearance, sensor, severity=self.severity)
        else:
            study = grasp(machine, tip, self.motion, sensor, severity=self.severity)
        folder = run_folder(self.out, f"moving-{self.job}-{self.motion}", files.WRITTEN, self.force)
        stopper = Stopper()
        with progress_bar() as bar, contextlib.ExitStack() as stack:
            stage = bar.add_task("compiling", total=runs * len(kinds))

            def told(kind: Knowledge, number: int, trial: TargetTrial) -> None:
                bar.update(stage, advance=1, description=f"trial {number + 1}: {kind}")

            stack.enter_context(stopper.listening())
            done = trials(study, runs, kinds, backend=self.backend, told=told, stop=stopper)
            done = {kind: found for kind, found in done.items() if found}
            if not done:
                return INTERRUPTED
            figures = {kind: outcome(kind, found) for kind, found in done.items()}
            with filled(folder) as fresh:
                written = files.save(study, done, figures, fresh)
                bar.update(stage, description="plots", total=None)
                written += pictures.plot(study, done, fresh)
            if self.film and not stopper():
                pair = {k: done[k][0] for k in (min(done, key=kinds.index), max(done, key=kinds.index))}
                bar.update(stage, description="film", total=1, completed=0)
                with filled(folder) as fresh:
                    drawn = pictures.film(
                        study, pair, fresh / "film", lambda part: bar.update(stage, completed=part), stopper
                    )
                written += [] if drawn is None else [drawn]
        heads = ("the object is known by", "done", "rms mm", "largest mm", "degrees", "time s", "rate", "known to mm")
        rows = ((pictures.LABELS[kind], *_cells(found)) for kind, found in figures.items())
        out().print(table(heads, rows, f"{machine.name}, {self.job}, {self.motion}"))
        for kind, found in figures.items():
            for reason, count in found.reasons.items():
                say(f"{pictures.LABELS[kind]}: {count} times {reason}")
        say(f"{folder}: {', '.join(path.name for path in written)}")
        if stopper():
            tell("interrupted: the trials that were done are written")
        return INTERRUPTED if stopper() else 0


def _cells(found: Outcome) -> list[str]:
    """A row of the table."""
    sizes = (1e3 * found.rms, 1e3 * found.worst, degrees(found.angle))
    shown = [f"{size:.3f}" if isfinite(size) else "-" for size in sizes]
    time = f"{found.time[0]:.2f}" if found.successes else "-"
    return [f"{found.successes} of {found.done}", *shown, time, f"{found.rate:.2f}", f"{1e3 * found.knowledge_rms:.3f}"]
