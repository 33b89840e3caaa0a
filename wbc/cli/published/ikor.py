"""``wbc published ikor``: the published driver by Full Space Parameterization, its runs and runs from its files."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from wbc.cli.reading import Option, numbers
from wbc.errors import RangeError, ShapeError

if TYPE_CHECKING:
    from wbc.published.ikor import ArmMachine, CourseRun, Trajectory
    from wbc.published.ikor.cases import Printed

#: Exit code of a run that ended early; files that are none end with 2
PARTIAL = 1
#: Files of a run
WRITTEN = ("summary.json", "norms.*", "film.*", "CheezyAngles", "TrajectoryPts", "EulerAngles", "*_data")


@dataclass(frozen=True)
class How:
    """How a trajectory is followed, and where what came of it goes."""

    PANEL: ClassVar[str] = "How it follows, and what it writes"
    method: Annotated[int, "0 FSP and limits, 1 pseudo-inverse, 2 FSP and obstacles, 3 both, 4 FSP."] = 4
    resolver: Annotated[Literal["fsp", "pseudo_inverse", "stack"], "What makes the steps."] = "fsp"
    criterion: Annotated[Literal["norm", "acceleration", "energy", "torque", "power"], "What is least of a step."] = (
        "norm"
    )
    two_step: Annotated[bool, "Constraints in a second step."] = False
    ahead: Annotated[bool, "Constraints act before they are broken, tool and platform too."] = False
    margin: Annotated[float, "Kept from spheres [m]."] = 0.0
    damping: Annotated[float, "Of the inverse, near singularities [1]."] = 0.0
    step_limit: Annotated[float | None, "Longest step of a joint [degrees], pi/180 m for each where it slides."] = None
    loop_back: Annotated[bool, "Back by some steps, a joint held."] = False
    spheres: Annotated[Path | None, "File sphere_data."] = None
    out: Annotated[Path | None, "Run folder. Default: runs/ikor-TIME."] = None
    force: Annotated[bool, "Write into a folder that has a run."] = False

    def settings(self) -> dict[str, Any]:
        """Fields of :class:`wbc.published.ikor.Settings`."""
        names = ("resolver", "criterion", "two_step", "ahead", "margin", "damping", "loop_back")
        return {
            **{name: getattr(self, name) for name in names},
            "method": self.method,
            "generator": "orthogonal" if self.ahead else "blocked",
            "step_limit": inf if self.step_limit is None else radians(self.step_limit),
        }

    def balls(self) -> Any:
        """Centres and radii of the spheres [n, 4]."""
        import numpy as np

        from wbc.published.ikor import files

        return files.read_spheres(self.spheres) if self.spheres else np.zeros((0, 4))

    def folder(self) -> Path:
        """For the run."""
        from wbc.cli.folders import run_folder

        return run_folder(self.out, "ikor", WRITTEN, self.force)


@dataclass(frozen=True)
class Cases(How):
    """Run published trajectories of redundant arms beside printed norms.

    Exit code 1 if one ends early.

    Example: wbc published ikor --case 1 --config 3x7
    """

    PANEL: ClassVar[str] = "What it follows"
    case: Annotated[Literal["1", "2", "3"] | None, "A published trajectory. Default: all."] = None
    config: Annotated[Literal["3x7", "3x10", "6x7", "6x10"] | None, "Rows and columns. Default: all."] = None
    consistent: Annotated[bool, "Without the defects of the printed norms."] = False

    def run(self) -> int:
        from wbc.cli.console import out, progress_bar, say, table, write_json
        from wbc.cli.folders import filled
        from wbc.published import ikor
        from wbc.published.ikor import cases
        from wbc.published.ikor.report import beside, save_norms

        balls, how, folder = self.balls(), self.settings(), self.folder()
        trajectories = [self.case] if self.case else list(cases.BETWEEN)
        chosen = [(t, c) for t in trajectories for c in ([self.config] if self.config else cases.CONFIGS)]
        rows: list[list[str]] = []
        figures: dict[str, Any] = {"legacy": not self.consistent}
        runs: dict[str, tuple[CourseRun, Printed | None]] = {}
        with progress_bar() as bar:
            stage = bar.add_task("runs", total=len(chosen))
            for t, c in chosen:
                run, printed = ikor.case(t, c, legacy=not self.consistent, spheres=balls, **how), ikor.printed()[t, c]
                bar.advance(stage)
                runs[f"{t}-{c}"] = run, printed
                figures[f"{t}-{c}"], cells = beside(run, printed, t, c)
                rows.append([f"{t} {c}", *cells, *[""] * (7 - len(cells))])
                if run.stop is ikor.Stop.INTERRUPTED:
                    break
        heads = ("run", "values", "rms", "largest", "first", "measured", "last", "measured")
        out().print(table(heads, rows))
        say("differences: ln(measured / printed)")
        if len(runs) == 1:
            _steps(run, printed)
        with filled(folder) as fresh:
            write_json(fresh / "summary.json", figures)
            save_norms(fresh, runs)
        say(folder)
        return PARTIAL if any(run.code for run, _ in runs.values()) else 0


@dataclass(frozen=True)
class RunFiles(How):
    """Run the published driver from its files, a line, an arc or rates.

    Exit code 1 if it ends early, 2 for a file with a bad line, which is named.

    Example: wbc published ikor-run --line -0.8,-0.356,0.6
    """

    PANEL: ClassVar[str] = "What it follows"
    robot: Annotated[str, "hermies, airarm, planar or a file ROBOT.dat."] = "hermies"
    base: Annotated[str, "Platform: none, holonomic, differential or car."] = "none"
    trajectory: Annotated[Path | None, "File TrajectoryPts."] = None
    max_points: Annotated[int, "Points beyond these are left out."] = 1000
    angles: Annotated[Path | None, "File EulerAngles; controls them, too."] = None
    line: Annotated[str | None, "X,Y,Z[,YAW,PITCH,ROLL] [m, degrees]: a line from home."] = None
    arc: Annotated[str | None, "X,Y,DEGREES[,YAW]: round X,Y from home, turning by YAW [m, degrees]."] = None
    rates: Annotated[Path | None, "CSV file of an operator's rates: time, pair, r1 ... r6."] = None
    keys: Annotated[bool, "Rates from the keyboard, at 50 Hz."] = False
    start: Annotated[str | None, "X,Y,Z[,YAW,PITCH,ROLL]: where a line, arc or operator begins [m, degrees]."] = None
    switch: Annotated[
        tuple[str, ...], "POINT:orientation=on|off,platform=on|off, from a point on; may be repeated."
    ] = ()
    rows: Annotated[str | None, "Of x,y,z,yaw,pitch,roll. Default: x,y,z, and all with --angles."] = None
    weights: Annotated[tuple[float, ...] | None, "Of each column, with commas; a small one moves more [1]."] = None
    polygons: Annotated[Path | None, "File polygon_data: obstacles of planar arms."] = None
    film: Annotated[Literal["gif", "html"] | None, "A film; html plays, steps and scrubs."] = None

    def run(self) -> int:
        from wbc.cli.console import say, tell, write_json
        from wbc.cli.folders import filled
        from wbc.published.ikor import Driver, Settings, Switch, files, posed
        from wbc.published.ikor.report import figures_of, save_norms
        from wbc.published.ikor.settings import AXES
        from wbc.teleop import Keyboard, RateFile
        from wbc.teleop.keyboard import HELP

        ways = {name: getattr(self, name) for name in ("trajectory", "line", "arc", "rates", "keys")}
        given = [name for name, value in ways.items() if value]
        if len(given) != 1:
            raise RangeError("trajectory", given, f"expected one of {', '.join(ways)}")
        if self.start and self.trajectory:
            raise RangeError("start", self.start, "expected a line, an arc, rates or keys; files have a start")
        (goal, euler), (first, turn) = _pose("line", self.line), _pose("start", self.start)
        way = [] if self.arc is None else numbers("arc", self.arc)
        if len(way) not in (0, 3, 4):
            raise ShapeError("arc", self.arc, "expected X,Y,DEGREES or X,Y,DEGREES,YAW")
        switches, balls = tuple(map(Switch.read, self.switch)), self.balls()
        oriented = self.angles is not None or euler is not None or len(way) == 4
        axes = tuple(self.rows.split(",")) if self.rows else AXES if oriented else AXES[:3]
        machine = self._machine()
        blocks = files.read_polygons(self.polygons) if self.polygons else []
        driver = Driver(machine, Settings(rows=axes, switches=switches, **self.settings()), balls, blocks)
        start = None if first is None else posed(machine, first, turn)
        path = self._path(machine, goal, euler, way, start)
        source = None if self.rates is None else contextlib.nullcontext(RateFile(self.rates))
        folder = self.folder()
        if path is not None:
            run = driver.run(path)
        else:
            if source is None:
                tell(HELP)
            with source or Keyboard(0.1, 0.3).terminal() as operator:
                run = driver.operate(operator, start, realtime=self.keys)
        figures = {**figures_of(run), "assumed": list(machine.assumed)}
        with filled(folder) as fresh:
            if path is not None:
                files.write_trajectory(fresh / "TrajectoryPts", machine, path, fresh / "EulerAngles")
            files.write_angles(fresh / "CheezyAngles", machine, run.q)
            if self.spheres:
                files.write_spheres(fresh / "sphere_data", balls)
            if self.polygons:
                files.write_polygons(fresh / "polygon_data", blocks)
            write_json(fresh / "summary.json", figures)
            save_norms(fresh, {"run": (run, None)})
        if self.film is not None and len(run.norms):
            from wbc.published.ikor.film import save_film

            with filled(folder) as fresh:
                save_film(machine, run, balls, fresh / f"film.{self.film}", blocks)
        for key, value in figures.items():
            say(f"{key.replace('_', ' '):>23}  {value}")
        say(folder)
        return PARTIAL if run.code else 0

    def _machine(self) -> ArmMachine:
        """That of the name, with other weights of its columns."""
        from wbc import validation
        from wbc.published.ikor import files

        machine = files.named(self.robot, self.base)
        if self.weights is None:
            return machine
        b = validation.ordinary_array("weights", self.weights, (machine.joints,))
        if (b <= 0.0).any():
            raise RangeError("weights", self.weights, "expected numbers above 0")
        return replace(machine, weights=b)

    def _path(self, machine: ArmMachine, goal: Any, euler: Any, way: Any, start: Any) -> Trajectory | None:
        """None: an operator's."""
        from wbc import validation
        from wbc.published.ikor import arc_from, files, line_to

        if self.trajectory is not None:
            most = validation.integer("max-points", self.max_points, 1)
            return files.read_trajectory(self.trajectory, machine, self.angles, most)
        if goal is not None:
            return line_to(machine, goal, euler, start)
        if len(way):
            return arc_from(machine, way[:2], radians(way[2]), radians(way[3]) if len(way) == 4 else 0.0, start)
        return None


@dataclass(frozen=True)
class Space:
    """Show the solution space of one Jacobian.

    By both generators.
    """

    file: Annotated[Path, Option("File FSP_data.", placed=True)]

    def run(self) -> None:
        from wbc.cli.console import say
        from wbc.published.ikor import files
        from wbc.resolvers.fsp import best, blocked, orthogonal

        J, x = files.read_jacobian(self.file)
        for make in (blocked, orthogonal):
            space = make(J, x)
            condition = f"cond G {space.condition():.3g}"
            say(f"{make.__name__}: rank {space.rank}, {space.span} vectors, {space.status}, {condition}")
            for g in space.vectors:
                say("  " + " ".join(f"{value:12.8f}" for value in g))
        say("least norm\n  " + " ".join(f"{value:12.8f}" for value in best(space).v))


def _pose(field: str, text: str | None) -> tuple[Any, Any]:
    """Position [m] and, if they are there, yaw, pitch, roll [rad]; None without."""
    if text is None:
        return None, None
    found = numbers(field, text)
    if len(found) not in (3, 6):
        raise ShapeError(field, text, "expected X,Y,Z or X,Y,Z,YAW,PITCH,ROLL")
    return found[:3], [radians(angle) for angle in found[3:]] if len(found) == 6 else None


def _steps(run: CourseRun, printed: Printed) -> None:
    """Printed and measured side by side, every tenth legible step."""
    from wbc.cli.console import say

    say(f"{'step':>6} {'printed FSP':>14} {'printed J+':>14} {'measured':>14}")
    for k in range(0, len(printed.steps), 10):
        step = int(printed.steps[k])
        if step > len(run.norms):
            break
        values = (printed.fsp[k], printed.pseudo_inverse[k], run.norms[step - 1])
        say(f"{step:6d} " + " ".join(f"{x:14.6f}" for x in values))
