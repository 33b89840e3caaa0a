"""``wbc ikor``: the published driver by Full Space Parameterization, its runs and runs from its files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from wbc.published.ikor import Run

#: Exit code of a run that ended early; files that are none end with 2
PARTIAL = 1
_WHAT, _HOW, _OUTPUT = "What it follows", "How it follows", "What it writes"

Trajectory = Annotated[
    str | None, typer.Option("--case", help="A published trajectory, 1 or 3. Default: both.", rich_help_panel=_WHAT)
]
Config = Annotated[str | None, typer.Option(help="3x7, 3x10, 6x7 or 6x10. Default: all.", rich_help_panel=_WHAT)]
Consistent = Annotated[
    bool, typer.Option("--consistent", help="Without the defects of the printed norms.", rich_help_panel=_WHAT)
]
Machine = Annotated[str, typer.Option(help="hermies, airarm, planar or a file ROBOT.dat.", rich_help_panel=_WHAT)]
Points = Annotated[Path | None, typer.Option(help="File TrajectoryPts, instead of a case.", rich_help_panel=_WHAT)]
Line = Annotated[
    str | None,
    typer.Option(help="X,Y,Z[,YAW,PITCH,ROLL] in m and degrees: a line from home, instead.", rich_help_panel=_WHAT),
]
Jacobian = Annotated[
    Path | None, typer.Option(help="File FSP_data: only the vectors of its solution space.", rich_help_panel=_WHAT)
]
Angles = Annotated[Path | None, typer.Option(help="File EulerAngles; controls them, too.", rich_help_panel=_WHAT)]
Spheres = Annotated[Path | None, typer.Option(help="File sphere_data.", rich_help_panel=_WHAT)]
Base = Annotated[str, typer.Option(help="Platform: none, holonomic, differential or car.", rich_help_panel=_WHAT)]
MethodCode = Annotated[
    int,
    typer.Option(
        help="0 FSP and limits, 1 pseudo-inverse, 2 FSP and obstacles, 3 both, 4 FSP.",
        min=0,
        max=4,
        rich_help_panel=_HOW,
    ),
]
Resolver = Annotated[str, typer.Option(help="fsp, pseudo_inverse or stack.", rich_help_panel=_HOW)]
Rows = Annotated[
    str | None,
    typer.Option(help="Of x,y,z,yaw,pitch,roll. Default: x,y,z, and all with --angles.", rich_help_panel=_HOW),
]
TwoStep = Annotated[bool, typer.Option("--two-step", help="Constraints in a second step.", rich_help_panel=_HOW)]
Ahead = Annotated[
    bool,
    typer.Option(
        "--ahead", help="Constraints act before they are broken, tool and platform too.", rich_help_panel=_HOW
    ),
]
Margin = Annotated[float, typer.Option(help="Kept from spheres, in m.", rich_help_panel=_HOW)]
Damping = Annotated[float, typer.Option(help="Of the inverse, near singularities.", rich_help_panel=_HOW)]
StepLimit = Annotated[
    float | None,
    typer.Option(help="Longest step of a joint, in degrees; pi/180 m for each where it slides.", rich_help_panel=_HOW),
]
LoopBack = Annotated[bool, typer.Option("--loop-back", help="Back by some steps, a joint held.", rich_help_panel=_HOW)]
Out = Annotated[Path | None, typer.Option(help="Run folder. Default: runs/ikor-TIME.", rich_help_panel=_OUTPUT)]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that has a run.", rich_help_panel=_OUTPUT)]


def ikor(
    case: Trajectory = None,
    config: Config = None,
    consistent: Consistent = False,
    robot: Machine = "hermies",
    trajectory: Points = None,
    line: Line = None,
    jacobian: Jacobian = None,
    angles: Angles = None,
    spheres: Spheres = None,
    base: Base = "none",
    method: MethodCode = 4,
    resolver: Resolver = "fsp",
    rows: Rows = None,
    two_step: TwoStep = False,
    ahead: Ahead = False,
    margin: Margin = 0.0,
    damping: Damping = 0.0,
    step_limit: StepLimit = None,
    loop_back: LoopBack = False,
    out: Out = None,
    force: Force = False,
) -> None:
    """Run the published driver of redundant arms: its own trajectories, printed norms beside, or one from its files.

    Exit code 1 if a run from files ends early, 2 for a file with a bad line, which is named.

    Example: [bold]wbc ikor --case 1 --config 3x7[/bold]
    """
    from math import inf, radians

    import numpy as np

    from wbc.cli.console import run_folder
    from wbc.published.ikor import Method, Settings

    if jacobian is not None:
        _vectors(jacobian)
        return
    if trajectory is None and line is None:
        _published(case, config, not consistent, method, out, force)
        return
    from wbc.published.ikor import driver, files
    from wbc.published.ikor.settings import AXES

    numbers = None if line is None else _numbers(line)
    oriented = angles is not None or (numbers is not None and len(numbers) == 6)
    axes = tuple(rows.split(",")) if rows else AXES if oriented else AXES[:3]
    settings = Settings(
        Method(method), axes, resolver=resolver, two_step=two_step, ahead=ahead, margin=margin, damping=damping,
        generator="orthogonal" if ahead else "blocked", loop_back=loop_back,
        step_limit=inf if step_limit is None else radians(step_limit),
    )  # fmt: skip
    machine = _machine(robot, base)
    if numbers is not None:
        path = driver.line_to(machine, numbers[:3], np.radians(numbers[3:]) if oriented else None)
    else:
        path = files.read_trajectory(trajectory, machine, angles)
    balls = files.read_spheres(spheres) if spheres else np.zeros((0, 4))
    folder = run_folder("ikor", out, force)
    run = driver.Driver(machine, settings, balls).run(path)
    files.write_angles(folder / "CheezyAngles", machine, run.q)
    files.write_trajectory(folder / "TrajectoryPts", machine, path, folder / "EulerAngles")
    if spheres:
        files.write_spheres(folder / "sphere_data", balls)
    figures = {
        "code": int(run.code), "stop": str(run.stop), "message": run.message, "steps": len(run.norms),
        "last_error": float(run.errors[-1]) if len(run.errors) else None,
        "largest_norm": float(run.norms.max()) if len(run.norms) else None,
        "clearance": float(run.clearance.min()) if len(run.norms) and run.clearance.min() < inf else None,
        "steps_with_constraints": sum(map(bool, run.acted)), "given_up": sum(map(bool, run.given_up)),
        "assumed": list(machine.assumed),
    }  # fmt: skip
    _written(folder, figures, {"run": (run, None)})
    for key, value in figures.items():
        typer.echo(f"{key.replace('_', ' '):>23}  {value}")
    typer.echo(str(folder))
    if run.code:
        raise typer.Exit(PARTIAL)


def _machine(robot: str, base: str) -> Any:
    from wbc.published import ikor as published
    from wbc.published.ikor import files

    makers = {"hermies": published.hermies, "airarm": published.airarm}
    if robot in makers:
        return makers[robot](base)
    return published.planar() if robot == "planar" else files.read_robot(robot, base)


def _numbers(text: str) -> list[float]:
    from wbc.errors import ShapeError

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6):
        raise ShapeError("line", text, "expected X,Y,Z or X,Y,Z,YAW,PITCH,ROLL")
    return numbers


def _vectors(file: Path) -> None:
    """The space of one Jacobian by both generators."""
    from wbc.published.ikor import files
    from wbc.resolvers.fsp import best, blocked, orthogonal

    J, x = files.read_jacobian(file)
    for make in (blocked, orthogonal):
        space = make(J, x)
        typer.echo(
            f"{make.__name__}: rank {space.rank}, {space.span} vectors, {space.status}, cond G {space.condition():.3g}"
        )
        for g in space.vectors:
            typer.echo("  " + " ".join(f"{value:12.8f}" for value in g))
    typer.echo("least norm\n  " + " ".join(f"{value:12.8f}" for value in best(space).v))


def _published(case: str | None, config: str | None, legacy: bool, method: int, out: Path | None, force: bool) -> None:
    """All that are asked for: a line each, or every tenth step of one."""
    import numpy as np
    from rich.table import Table

    from wbc.cli.console import out as console
    from wbc.cli.console import run_folder
    from wbc.published import ikor as published
    from wbc.published.ikor import cases

    chosen = [(t, c) for t in ([case] if case else cases.BETWEEN) for c in ([config] if config else cases.CONFIGS)]
    table = Table(header_style="bold", box=None, pad_edge=False)
    for name in ("run", "values", "rms", "largest", "first", "measured", "last", "measured"):
        table.add_column(name, justify="right", no_wrap=True)
    figures: dict[str, Any] = {"legacy": legacy}
    runs: dict[str, Any] = {}
    for t, c in chosen:
        run = published.case(t, c, legacy=legacy, method=published.Method(method))
        off, table_of = published.differences(run, t, c), published.printed()[t, c]
        good = np.flatnonzero(np.isfinite(table_of.fsp))
        ends = [(float(table_of.fsp[k]), float(run.norms[int(table_of.steps[k]) - 1])) for k in (good[0], good[-1])]
        rms, worst = float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())
        cells = [f"{x:.6f}" for pair in ends for x in pair]
        table.add_row(f"{t} {c}", str(len(off)), f"{rms:.1e}", f"{worst:.1e}", *cells)
        key = f"{t}-{c}"
        figures[key] = {"values": len(off), "rms": rms, "largest": worst, "last_error": float(run.errors[-1])}
        runs[key] = (run, table_of)
    folder = run_folder("ikor", out, force)
    console().print(table)
    console().print("differences: ln(measured / printed)", style="dim")
    if len(chosen) == 1:
        _steps(*runs[key])
    _written(folder, figures, runs)
    typer.echo(str(folder))


def _steps(run: Run, printed: Any) -> None:
    """Printed and measured side by side, every tenth legible step."""
    typer.echo(f"{'step':>6} {'printed FSP':>14} {'printed J+':>14} {'measured':>14}")
    for k in range(0, len(printed.steps), 10):
        step = int(printed.steps[k])
        numbers = (printed.fsp[k], printed.pseudo_inverse[k], run.norms[step - 1])
        typer.echo(f"{step:6d} " + " ".join(f"{x:14.6f}" for x in numbers))


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
