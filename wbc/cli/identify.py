"""``wbc identify``: inertias of a simulated robot from a motion that shows much."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Name = Annotated[str, typer.Argument(help="A name of `wbc robots`, or a URDF or MJCF file; on a fixed base.")]
Far = Annotated[float, typer.Option(help="How far the true bodies are from the model's: deviation of logarithms.")]
Noise = Annotated[float, typer.Option(help="Standard deviation of the encoders, in rad and m.")]
Tries = Annotated[int, typer.Option(help="Motions that are looked at for the one that shows most.")]
Seed = Annotated[int, typer.Option(help="Of the search, of the true bodies and of all noise.")]
Out = Annotated[Path | None, typer.Option(help="Folder for law, plot and figures. Default: runs/identify-TIME.")]
Force = Annotated[bool, typer.Option(help="Write into a folder that has such a run.")]


def identify(
    robot: Name,
    far: Far = 0.2,
    noise: Noise = 1e-5,
    tries: Tries = 200,
    seed: Seed = 0,
    out: Out = None,
    force: Force = False,
) -> None:
    """Find the inertias of a simulated robot from a motion that shows much.

    See docs/identification.md.

    Example: [bold]wbc identify ur5 --far 0.3[/bold]
    """
    import json

    import numpy as np
    from rich.table import Table

    from wbc import robots
    from wbc.cli.console import out as console
    from wbc.cli.console import progress_bar
    from wbc.cli.folders import filled, run_folder
    from wbc.identification.experiment import experiment
    from wbc.trajectory import plot

    machine = robots.load(robot)
    written = ("identified.json", "motion.png", "motion.npz")
    folder = run_folder(out, "identify", written, force, clear=False, made=False)
    with progress_bar() as bar:
        task = bar.add_task("motions", total=tries + 1)
        done = experiment(machine, far=far, noise=noise, tries=tries, seed=seed, tick=lambda: bar.advance(task))
    motion, found = done.motion, done.found
    columns = len(found.parameters)
    console().print(f"{found.base.count} of {columns} parameters can be known; a motion of {motion.law.duration:.1f} s")
    console().print(
        f"log det of its information {motion.score:.1f}, of the first random motions {motion.first:.1f} at best"
    )
    console().print(f"its limits: {motion.law.certificate}", markup=False)
    table = Table(header_style="bold", box=None, pad_edge=False)
    table.add_column("torques not explained", no_wrap=True)
    for head in ("by the model", "by the fit", "viscous", "Coulomb"):
        table.add_column(head, justify="right")
    for dof, name in enumerate(machine.dof_names):
        cells = (done.check[1, dof], done.check[0, dof], *(part[dof] for part in found.friction()))
        table.add_row(name, *(f"{cell:.3g}" for cell in cells))
    console().print(table)
    spread = float(np.sqrt((done.errors**2).mean()))
    console().print(f"on a motion that the fit has not seen; base parameters are {spread:.2f} standard deviations off")
    row = {
        "robot": machine.name, "parameters": columns, "base": found.base.count, "condition": found.base.condition,
        "score": motion.score, "first": motion.first, "duration": motion.law.duration, "deviations": spread,
        "model": done.check[1].tolist(), "fit": done.check[0].tolist(),
        "inertias": {str(name): np.array(body.toDynamicParameters()).tolist() for name, body in
                     zip(list(found.robot.model.names)[1:], list(found.robot.model.inertias)[1:], strict=True)},
    }  # fmt: skip
    with filled(folder, written) as fresh:
        (fresh / "identified.json").write_text(json.dumps(row, indent=1) + "\n")
        motion.law.save(fresh / "motion.npz")
        plot(motion.law, fresh / "motion.png")
    console().print(str(folder))
