"""``wbc ikor``: the published driver by Full Space Parameterization, its runs and runs from its files."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wbc.cli.console import say
from wbc.cli.folders import filled, run_folder

if TYPE_CHECKING:
    from wbc.published.ikor import Run

#: Exit code of a run that ended early; files that are none end with 2
PARTIAL = 1
#: Files of a run
WRITTEN = ("summary.json", "norms.*", "film.*", "CheezyAngles", "TrajectoryPts", "EulerAngles", "*_data")
_what, _how, _output = (
    functools.partial(typer.Option, rich_help_panel=title)
    for title in ("What it follows", "How it follows", "What it writes")
)

Trajectory = Annotated[str | None, _what("--case", help="A published trajectory: 1, 2 or 3. Default: all.")]
Config = Annotated[str | None, _what(help="3x7, 3x10, 6x7 or 6x10. Default: all.")]
Consistent = Annotated[bool, _what("--consistent", help="Without the defects of the printed norms.")]
Machine = Annotated[str, _what(help="hermies, airarm, planar or a file ROBOT.dat.")]
Points = Annotated[Path | None, _what(help="File TrajectoryPts, instead of a case.")]
Most = Annotated[int, _what("--max-points", help="Points beyond these are left out.", min=1)]
Begin = Annotated[str | None, _what("--from", help="X,Y,Z[,YAW,PITCH,ROLL]: where a line, arc or operator begins.")]
Line = Annotated[str | None, _what(help="X,Y,Z[,YAW,PITCH,ROLL] in m and degrees: a line from home, instead.")]
Arc = Annotated[str | None, _what(help="X,Y,DEGREES[,YAW]: round X,Y from home, turning by YAW, instead.")]
Switches = Annotated[
    list[str] | None, _what("--switch", help="POINT:orientation=on|off,platform=on|off, from a point on; repeatable.")
]
Jacobian = Annotated[Path | None, _what(help="File FSP_data: only the vectors of its solution space.")]
Rates = Annotated[Path | None, _what(help="CSV file of an operator's rates: time, pair, r1 ... r6.")]
Keys = Annotated[bool, _what("--keys", help="Rates from the keyboard, at 50 Hz.")]
Angles = Annotated[Path | None, _what(help="File EulerAngles; controls them, too.")]
Spheres = Annotated[Path | None, _what(help="File sphere_data.")]
Polygons = Annotated[Path | None, _what(help="File polygon_data: obstacles of planar arms.")]
Base = Annotated[str, _what(help="Platform: none, holonomic, differential or car.")]
MethodCode = Annotated[
    int, _how(help="0 FSP and limits, 1 pseudo-inverse, 2 FSP and obstacles, 3 both, 4 FSP.", min=0, max=4)
]
Resolver = Annotated[str, _how(help="fsp, pseudo_inverse or stack.")]
Least = Annotated[str, _how("--criterion", help="Least of a step: norm, acceleration, energy, torque or power.")]
Weights = Annotated[str | None, _how(help="Of each column, with commas; a joint of a small one moves more.")]
Rows = Annotated[str | None, _how(help="Of x,y,z,yaw,pitch,roll. Default: x,y,z, and all with --angles.")]
TwoStep = Annotated[bool, _how("--two-step", help="Constraints in a second step.")]
Ahead = Annotated[bool, _how("--ahead", help="Constraints act before they are broken, tool and platform too.")]
Margin = Annotated[float, _how(help="Kept from spheres, in m.")]
Damping = Annotated[float, _how(help="Of the inverse, near singularities.")]
StepLimit = Annotated[
    float | None, _how(help="Longest step of a joint, in degrees; pi/180 m for each where it slides.")
]
LoopBack = Annotated[bool, _how("--loop-back", help="Back by some steps, a joint held.")]
Out = Annotated[Path | None, _output(help="Run folder. Default: runs/ikor-TIME.")]
Film = Annotated[str | None, _output(help="gif, or html: plays, steps and scrubs.")]
Force = Annotated[bool, _output("--force", help="Write into a folder that has a run.")]


def ikor(
    case: Trajectory = None,
    config: Config = None,
    consistent: Consistent = False,
    robot: Machine = "hermies",
    trajectory: Points = None,
    max_points: Most = 1000,
    line: Line = None,
    arc: Arc = None,
    begin: Begin = None,
    switch: Switches = None,
    rates: Rates = None,
    keys: Keys = False,
    jacobian: Jacobian = None,
    angles: Angles = None,
    spheres: Spheres = None,
    polygons: Polygons = None,
    base: Base = "none",
    method: MethodCode = 4,
    resolver: Resolver = "fsp",
    criterion: Least = "norm",
    weights: Weights = None,
    rows: Rows = None,
    two_step: TwoStep = False,
    ahead: Ahead = False,
    margin: Margin = 0.0,
    damping: Damping = 0.0,
    step_limit: StepLimit = None,
    loop_back: LoopBack = False,
    film: Film = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Run the published driver of redundant arms: its own trajectories, printed norms beside, or one from its files.

    Exit code 1 if a run from files ends early, 2 for a file with a bad line, which is named.

    Example: [bold]wbc ikor --case 1 --config 3x7[/bold]
    """
    from math import inf, radians

    import numpy as np

    from wbc import validation
    from wbc.cli.planning import comma_numbers
    from wbc.errors import RangeError, ShapeError
    from wbc.published.ikor import Driver, Method, Settings, arc_from, files, line_to, posed
    from wbc.published.ikor.settings import AXES

    if jacobian is not None:
        _vectors(jacobian)
        return
    ways = {
        "trajectory": trajectory,
        "line": line,
        "arc": arc,
        "rates": rates,
        "keys": keys,
        "case": case,
        "config": config,
    }
    given = [name for name, value in ways.items() if value]
    if len(set(given) - {"config"}) > 1 or (given[:1] != ["case"] and given[1:] == ["config"]):
        raise RangeError(given[0], given, "expected one of these, not several")
    if film is not None:
        validation.one_of("film", film, ("gif", "html"))
    if begin and (trajectory or not set(given) - {"case", "config"}):
        raise RangeError("from", begin, "expected a line, an arc, rates or keys; files and cases have a start")
    (goal, euler), (first, turn) = _pose("line", line), _pose("from", begin)
    way = np.zeros(3) if arc is None else comma_numbers("arc", arc)
    if len(way) not in (3, 4):
        raise ShapeError("arc", arc, "expected X,Y,DEGREES or X,Y,DEGREES,YAW")
    balls = files.read_spheres(spheres) if spheres else np.zeros((0, 4))
    how: dict[str, Any] = {
        "criterion": criterion, "switches": tuple(map(_switch, switch or ())),
        "method": Method(method), "resolver": resolver, "two_step": two_step, "ahead": ahead, "margin": margin,
        "damping": damping, "generator": "orthogonal" if ahead else "blocked", "loop_back": loop_back,
        "step_limit": inf if step_limit is None else radians(step_limit),
    }  # fmt: skip
    if not set(given) - {"case", "config"}:
        if robot != "hermies" or base != "none" or any((rows, angles, film, polygons, weights, switch)):
            reason = (
                "robot, base, rows, angles, film, polygons, weights and switch belong to a trajectory, line or rates"
            )
            raise RangeError("case", case, reason)
        _published(case, config, not consistent, balls, how, _folder(out, force))
        return
    oriented = angles is not None or euler is not None or len(way) == 4
    axes = tuple(rows.split(",")) if rows else AXES if oriented else AXES[:3]
    machine = _weighted(_machine(robot, base), weights)
    blocks = files.read_polygons(polygons) if polygons else []
    driver, path = Driver(machine, Settings(rows=axes, **how), balls, blocks), None
    start = None if first is None else posed(machine, first, turn)
    if trajectory is not None:
        path = files.read_trajectory(trajectory, machine, angles, max_points)
    elif goal is not None:
        path = line_to(machine, goal, euler, start)
    elif arc is not None:
        path = arc_from(machine, way[:2], radians(way[2]), radians(way[3]) if len(way) == 4 else 0.0, start)
    source = _source(rates) if path is None else None
    folder = _folder(out, force)
    if path is not None:
        run = driver.run(path)
    else:
        with source or _keyboard() as operator:
            run = driver.operate(operator, start, realtime=keys)
    figures = {
        "code": int(run.code), "stop": str(run.stop), "message": run.message, "steps": len(run.norms),
        "last_error": float(run.errors[-1]) if len(run.errors) else None,
        "largest_norm": float(run.norms.max()) if len(run.norms) else None,
        "clearance": float(run.clearance.min()) if len(run.norms) and run.clearance.min() < inf else None,
        **_times(run), "steps_with_constraints": sum(map(bool, run.acted)), "given_up": sum(map(bool, run.given_up)),
        "assumed": list(machine.assumed),
    }  # fmt: skip
    with filled(folder) as fresh:
        if path is not None:
            files.write_trajectory(fresh / "TrajectoryPts", machine, path, fresh / "EulerAngles")
        files.write_angles(fresh / "CheezyAngles", machine, run.q)
        if spheres:
            files.write_spheres(fresh / "sphere_data", balls)
        if polygons:
            files.write_polygons(fresh / "polygon_data", blocks)
        _written(fresh, figures, {"run": (run, None)})
    if film is not None and len(run.norms):
        from wbc.published.ikor.film import save_film

        with filled(folder) as fresh:
            save_film(machine, run, balls, fresh / f"film.{film}", blocks)
    for key, value in figures.items():
        say(f"{key.replace('_', ' '):>23}  {value}")
    say(str(folder))
    if run.code:
        raise typer.Exit(PARTIAL)


def _pose(field: str, text: str | None) -> tuple[Any, Any]:
    """Position [m] and, if they are there, yaw, pitch, roll [rad]; None without."""
    import numpy as np

    from wbc.cli.planning import comma_numbers
    from wbc.errors import ShapeError

    if text is None:
        return None, None
    numbers = comma_numbers(field, text)
    if len(numbers) not in (3, 6):
        raise ShapeError(field, text, "expected X,Y,Z or X,Y,Z,YAW,PITCH,ROLL")
    return numbers[:3], np.radians(numbers[3:]) if len(numbers) == 6 else None


def _switch(text: str) -> Any:
    """``POINT:what=on|off,what=on|off``."""
    from wbc import validation
    from wbc.errors import ShapeError
    from wbc.published.ikor import Switch

    point, _, changes = text.partition(":")
    pairs = [change.split("=") for change in changes.split(",")]
    if not point.isdecimal() or not point.isascii() or any(len(pair) != 2 for pair in pairs):
        raise ShapeError("switch", text, "expected POINT:orientation=on|off,platform=on|off")
    states = {
        validation.one_of("switch", name, ("orientation", "platform")): validation.one_of(name, state, ("on", "off"))
        for name, state in pairs
    }
    return Switch(int(point), **{name: state == "on" for name, state in states.items()})


def _weighted(machine: Any, weights: str | None) -> Any:
    """The machine with other weights of its columns."""
    from dataclasses import replace

    from wbc import validation
    from wbc.cli.planning import comma_numbers
    from wbc.errors import RangeError

    if weights is None:
        return machine
    b = validation.ordinary_array("weights", comma_numbers("weights", weights), (machine.joints,))
    if (b <= 0.0).any():
        raise RangeError("weights", weights, "expected numbers above 0")
    return replace(machine, weights=b)


def _times(run: Run) -> dict[str, float | None]:
    """Of steps [ms]."""
    import numpy as np

    some = len(run.seconds) > 0
    return {
        "median_step_ms": 1e3 * float(np.median(run.seconds)) if some else None,
        "longest_step_ms": 1e3 * float(run.seconds.max()) if some else None,
    }


def _source(rates: Path | None) -> Any:
    """Orders from a file, or none."""
    import contextlib

    from wbc.teleop import RateFile

    return None if rates is None else contextlib.nullcontext(RateFile(rates))


def _keyboard() -> Any:
    """Orders from the terminal, with a hint of what its keys do."""
    from wbc.cli.console import err
    from wbc.teleop import Keyboard
    from wbc.teleop.keyboard import HELP

    err().print(HELP, soft_wrap=True)
    return Keyboard(0.1, 0.3).terminal()


def _machine(robot: str, base: str) -> Any:
    from wbc.published import ikor as published
    from wbc.published.ikor import files

    makers = {"hermies": published.hermies, "airarm": published.airarm}
    if robot in makers:
        return makers[robot](base)
    return published.planar() if robot == "planar" else files.read_robot(robot, base)


def _vectors(file: Path) -> None:
    """The space of one Jacobian by both generators."""
    from wbc.published.ikor import files
    from wbc.resolvers.fsp import best, blocked, orthogonal

    J, x = files.read_jacobian(file)
    for make in (blocked, orthogonal):
        space = make(J, x)
        say(f"{make.__name__}: rank {space.rank}, {space.span} vectors, {space.status}, cond G {space.condition():.3g}")
        for g in space.vectors:
            say("  " + " ".join(f"{value:12.8f}" for value in g))
    say("least norm\n  " + " ".join(f"{value:12.8f}" for value in best(space).v))


def _published(
    case: str | None, config: str | None, legacy: bool, balls: Any, how: dict[str, Any], folder: Path
) -> None:
    """All that are asked for: a line each, or every tenth step of one."""
    import numpy as np
    from rich.table import Table

    from wbc.cli.console import out as console
    from wbc.cli.console import progress_bar
    from wbc.published import ikor as published
    from wbc.published.ikor import cases

    chosen = [(t, c) for t in ([case] if case else cases.BETWEEN) for c in ([config] if config else cases.CONFIGS)]
    table = Table(header_style="bold", box=None, pad_edge=False)
    for name in ("run", "values", "rms", "largest", "first", "measured", "last", "measured"):
        table.add_column(name, justify="right", no_wrap=True)
    figures: dict[str, Any] = {"legacy": legacy}
    runs: dict[str, Any] = {}
    with progress_bar() as bar:
        stage = bar.add_task("runs", total=len(chosen))
        for t, c in chosen:
            run, key = published.case(t, c, legacy=legacy, spheres=balls, **how), f"{t}-{c}"
            bar.advance(stage)
            runs[key] = run, published.printed()[t, c]
            figures[key] = {"stop": str(run.stop), "message": run.message, "steps": len(run.norms), **_times(run)}
            if run.code:
                table.add_row(f"{t} {c}", f"{len(run.norms)} steps: {run.stop}")
                continue
            off, (steps, fsp) = published.differences(run, t, c), (runs[key][1].steps, runs[key][1].fsp)
            ends = np.flatnonzero(np.isfinite(fsp))[[0, -1]]
            cells = [f"{x:.6f}" for k in ends for x in (fsp[k], run.norms[int(steps[k]) - 1])]
            rms, worst = float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())
            table.add_row(f"{t} {c}", str(len(off)), f"{rms:.1e}", f"{worst:.1e}", *cells)
            figures[key] |= {"values": len(off), "rms": rms, "largest": worst, "last_error": float(run.errors[-1])}
            if run.stop is published.Stop.INTERRUPTED:
                break
    console().print(table)
    console().print("differences: ln(measured / printed)", style="dim")
    if len(runs) == 1:
        _steps(*runs[key])
    with filled(folder) as fresh:
        _written(fresh, figures, runs)
    say(str(folder))
    if any(run.code for run, _ in runs.values()):
        raise typer.Exit(PARTIAL)


def _steps(run: Run, printed: Any) -> None:
    """Printed and measured side by side, every tenth legible step."""
    say(f"{'step':>6} {'printed FSP':>14} {'printed J+':>14} {'measured':>14}")
    for k in range(0, len(printed.steps), 10):
        step = int(printed.steps[k])
        if step > len(run.norms):
            break
        numbers = (printed.fsp[k], printed.pseudo_inverse[k], run.norms[step - 1])
        say(f"{step:6d} " + " ".join(f"{x:14.6f}" for x in numbers))


def _folder(out: Path | None, force: bool) -> Path:
    return run_folder(out, "ikor", WRITTEN, force)


def _written(folder: Path, figures: dict[str, Any], runs: dict[str, Any]) -> None:
    """``summary.json``, ``norms.csv`` and ``norms.png``."""
    import csv

    from wbc import style

    (folder / "summary.json").write_text(json.dumps(figures, indent=1) + "\n")
    with (folder / "norms.csv").open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["run", "step", "norm", "error", "clearance"])
        for key, (run, _) in runs.items():
            for k, row in enumerate(zip(run.norms, run.errors, run.clearance, strict=True), 1):
                writer.writerow([key, k, *(repr(float(x)) for x in row)])
    with style.pyplot() as plt:
        high, wide = (2, len(runs) // 2) if len(runs) > 4 else (1, len(runs))
        size = 3.2 * max(2, wide), 3.2 * high
        figure, panels = plt.subplots(high, wide, figsize=size, layout="constrained", squeeze=False)
        for panel, (key, (run, printed)) in zip(panels.flat, runs.items(), strict=True):
            panel.plot(range(1, len(run.norms) + 1), run.norms, lw=1.6, label="measured")
            if printed is not None:
                panel.plot(printed.steps, printed.fsp, ".", ms=4, color="black", label="printed")
            panel.set_yscale("log")
            panel.set_title(key, fontsize=11)
            panel.set_xlabel("step")
        panels[0][0].set_ylabel("norm [deg$^2$]")
        panels[0][0].legend()
        figure.savefig(folder / "norms.png")
        plt.close(figure)
