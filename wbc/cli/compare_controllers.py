"""``wbc compare-controllers``: published controllers of an arm beside today's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Payload = Annotated[float, typer.Option(help="Mass at the tip that no controller knows of, in kg.")]
Rate = Annotated[float, typer.Option(help="Commands a second, in Hz.")]
Heavier = Annotated[float, typer.Option(help="How many times heavier links are than controllers think.")]
Noise = Annotated[float, typer.Option(help="Standard deviation of measured joints, in rad and m.")]
Only = Annotated[list[str] | None, typer.Option("--only", help="One controller by name; may be repeated.")]
Out = Annotated[Path | None, typer.Option(help="Folder for plot and figures. Default: runs/controllers-TIME.")]
Force = Annotated[bool, typer.Option(help="Write into a folder that has such a comparison.")]


def compare_controllers(
    payload: Payload = 2.125,
    rate: Rate = 100.0,
    heavier: Heavier = 1.0,
    noise: Noise = 0.0,
    only: Only = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Run three published controllers of a three-link arm and two of today on the same line of 0.58 m in 1 s.

    The payload is by default half the mass of the last link. See docs/dynamics_published.md.

    Example: [bold]wbc compare-controllers --rate 1000[/bold]
    """
    import json

    import numpy as np
    from rich.table import Table

    from wbc import validation
    from wbc.cli.console import out as console
    from wbc.cli.console import progress_bar
    from wbc.cli.folders import run_folder
    from wbc.published.newton_euler.comparison import LAWS, compare, loaded, save_plot

    names = [validation.one_of("only", name, LAWS) for name in only] if only else list(LAWS)
    hertz = validation.scalar("rate", rate, low=10.0, high=1e4, unit="Hz")
    loaded(payload, heavier)
    validation.scalar("noise", noise, low=0.0)
    folder = run_folder(out, "controllers", ("controllers.png", "controllers.json"), force)
    found = []
    with progress_bar() as bar:
        task = bar.add_task("controllers", total=len(names))
        try:
            for one in compare(payload, 1.0 / hertz, names, heavier=heavier, noise=noise):
                found.append(one)
                bar.advance(task)
        except KeyboardInterrupt:
            console().print(f"ended after {len(found)} of {len(names)} controllers")
            if not found:
                raise
    table = Table(header_style="bold", box=None, pad_edge=False)
    table.add_column("controller")
    for head in ("tip, mm", "at end", "tau 1", "tau 2", "tau 3", "us", "payload"):
        table.add_column(head, justify="right")
    rows = []
    for one in found:
        row = {"name": one.name, "microseconds": one.microseconds, "payload_kg": one.mass}
        if one.run is None:
            cells = ["ran away", "", "", "", ""]
        else:
            torques = np.abs(one.run.torques).max(axis=0).tolist()
            lengths = [1e3 * float(one.tip.max()), 1e3 * float(one.tip[-1])]
            row |= {"tip_mm": lengths[0], "end_mm": lengths[1], "torques": torques}
            cells = [f"{number:.3g}" for number in (*lengths, *torques)]
        rows.append(row)
        mass = "" if one.mass is None else f"{one.mass:.3f} kg"
        table.add_row(one.name, *cells, f"{one.microseconds:.0f}", mass)
    title = f"{payload:g} kg at the tip, unknown; {hertz:g} Hz"
    title += f"; links {heavier:g} times heavier" if heavier != 1.0 else ""
    title += f"; noise {noise:g}" if noise else ""
    console().print(title)
    console().print("tip: largest distance from its place; tau: largest torques [N m, N m, N]; us: a command in Python")
    console().print(table)
    save_plot(found, title, folder / "controllers.png")
    (folder / "controllers.json").write_text(
        json.dumps({"payload": payload, "rate": hertz, "heavier": heavier, "noise": noise, "rows": rows}, indent=1)
        + "\n"
    )
    console().print(str(folder))
