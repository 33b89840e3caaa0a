"""``wbc compare-controllers``: published controllers and today's on the published arm or any robot, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from wbc.motion_control.comparison import Compared

Name = Annotated[
    str | None, typer.Argument(help="A name of `wbc robots`, or a URDF or MJCF file. Default: the published arm.")
]
Base = Annotated[str | None, typer.Option(help="Base of the robot: fixed or floating.")]
Plant = Annotated[str, typer.Option(help="What simulates: pinocchio or mujoco.")]
Payload = Annotated[
    float | None,
    typer.Option(help="Mass at the tip that no controller knows of, in kg."),
]
Rate = Annotated[float | None, typer.Option(help="Commands a second, in Hz.")]
Heavier = Annotated[float | None, typer.Option(help="How many times heavier links are than controllers think.")]
Noise = Annotated[float | None, typer.Option(help="Standard deviation of measured joints, in rad and m.")]
Only = Annotated[list[str] | None, typer.Option("--only", help="One controller by name; may be repeated.")]
Gravity = Annotated[float | None, typer.Option(help="Gravity downwards, in m/s^2. Default: the robot's.")]
Out = Annotated[Path | None, typer.Option(help="Folder for plots and figures. Default: runs/controllers-TIME.")]
Force = Annotated[bool, typer.Option(help="Write into a folder that has such a comparison.")]


def compare_controllers(
    robot: Name = None,
    payload: Payload = None,
    rate: Rate = None,
    heavier: Heavier = None,
    noise: Noise = None,
    plant: Plant = "pinocchio",
    base: Base = None,
    gravity: Gravity = None,
    only: Only = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Controllers of torques beside each other, on the published arm or on any robot.

    Without a robot: the published three-link arm on its line of 0.58 m in 1 s. With one: all its joints swing for 2 s.
    The published controllers need a fixed base. Without --payload, --heavier, --noise and --rate: as modelled, with
    half the mass of the last link, or a tenth of the robot's, at the tip, with links 1.2 times heavier, with noise of
    1e-5; each at 100 Hz and at 1 kHz. See docs/motion_control.md.

    Example: [bold]wbc compare-controllers ur5 --payload 3 --rate 1000[/bold]
    """
    import json
    from dataclasses import replace

    import numpy as np

    from wbc import robots, validation
    from wbc.cli.console import out as console
    from wbc.cli.console import progress_bar
    from wbc.cli.folders import filled, run_folder
    from wbc.motion_control.comparison import (
        Condition,
        compare,
        save_plot,
        standard_conditions,
    )
    from wbc.motion_control.trial import PLANTS, loaded
    from wbc.published.newton_euler.comparison import published_scenario, scenario_with_published

    validation.one_of("plant", plant, PLANTS)
    if robot is None:
        scenario = published_scenario()
    else:
        machine = robots.load(robot, base=base)
        if gravity is not None:
            model = machine.model.copy()
            model.gravity.linear = np.array([0.0, 0.0, -validation.scalar("gravity", gravity, unit="m/s^2")])
            machine = replace(machine, model=model)
        scenario = scenario_with_published(machine)
    given = {"payload": payload, "heavier": heavier, "noise": noise, "rate": rate}
    chosen = {name: value for name, value in given.items() if value is not None}
    conditions = (Condition(**chosen),) if chosen else standard_conditions(scenario.payload)
    for condition in conditions:
        loaded(scenario.robot, condition.payload, condition.heavier, scenario.frame)
    names = scenario.names(only or ())
    written = ("controllers.json", "controllers-*.png")
    folder = run_folder(out, "controllers", written, force, clear=False, made=False)
    found: list[Compared] = []
    total = sum(len(names) * scenario.seconds * condition.rate for condition in conditions)
    rows: list[dict[str, object]] = []
    console().print(f"{scenario.robot.name}, {scenario.seconds:g} s, {plant}")
    console().print(
        "tip, in mm: largest distance from its place, and over the last tenth; largest torque in N m or N; us:"
    )
    console().print("a command in Python; payload: as learned, and the least standard deviation that the motion allows")
    with progress_bar() as bar:
        task = bar.add_task("controllers", total=total)
        for k, condition in enumerate(conditions, start=1):
            runs, interrupted = [], False
            try:
                for one in compare(scenario, condition, names, plant=plant, tick=lambda: bar.advance(task)):
                    runs.append(one)
            except KeyboardInterrupt:
                interrupted = True
                if not runs and not found:
                    raise
            found += runs
            if runs:
                console().print(_table(runs, str(condition)))
                rows += [_row(one) for one in runs]
                text = json.dumps({"robot": scenario.robot.name, "plant": plant, "rows": rows}, indent=1)
                # What is done is kept, whatever comes after
                with filled(folder, written if k == 1 else ()) as fresh:
                    save_plot(runs, f"{scenario.robot.name}: {condition}", fresh / f"controllers-{k}.png")
                    (fresh / "controllers.json").write_text(text + "\n")
            if interrupted:
                console().print(f"ended after {len(found)} of {len(names) * len(conditions)} runs")
                break
    console().print(str(folder))


def _table(runs: Sequence[Compared], title: str) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left", header_style="bold", box=None, pad_edge=False)
    table.add_column("controller", no_wrap=True)
    for head in ("largest", "at the end", "torque", "us", "payload"):
        table.add_column(head, justify="right", no_wrap=True)
    for one in runs:
        most = f"{abs(one.trial.torques).max():.3g}" if len(one.trial.torques) else ""
        off = ["ran away", ""] if one.trial.away else [f"{1e3 * one.largest:.3g}", f"{1e3 * one.residual:.3g}"]
        table.add_row(one.name, *off, most, f"{one.microseconds:.0f}", _learned(one))
    return table


def _learned(one: Compared) -> str:
    """What is claimed of the payload: nothing that the motion does not show to a tenth, or to 50 g."""
    if one.mass is None:
        return ""
    value, deviation = one.mass
    if not 2.0 * deviation <= max(0.1 * abs(value), 0.05):
        return "not shown by this motion"
    return f"{value:.4g} kg +- {deviation:.1g}"


def _row(one: Compared) -> dict[str, object]:
    """Numbers for the file; what is not finite is left out."""
    row: dict[str, object] = {"name": one.name, **asdict(one.condition), "ran_away": one.trial.away}
    row["microseconds"] = one.microseconds
    if not one.trial.away:
        row |= {"tip_mm": 1e3 * one.largest, "end_mm": 1e3 * one.residual}
        row["torques"] = abs(one.trial.torques).max(axis=0).tolist()
    if one.mass is not None:
        row |= {"payload_kg": one.mass[0], "deviation_kg": one.mass[1] if one.mass[1] < float("inf") else None}
    return row
