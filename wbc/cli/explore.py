"""``wbc explore``: what else a robot could have done at a configuration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from wbc.cli import options
from wbc.cli.folders import filled, run_folder

At = Annotated[str, typer.Option(help="Joint coordinates with commas, in rad and m. Default: neutral.")]
Kind = Annotated[str, typer.Option(help="What the frame holds: position, orientation or pose.")]
Rates = Annotated[str | None, typer.Option(help="Rates of these rows with commas. Default: it stands still.")]
Seeds = Annotated[int, typer.Option(help="Random configurations that pieces are searched from.", min=0)]
Through = Annotated[bool, typer.Option("--through", help="Trace beyond limits, which are windows then.")]
To = Annotated[str | None, typer.Option(help="X,Y,Z: where the frame goes straight to, resolved as a whole.")]
Points = Annotated[int, typer.Option(help="Targets on the way there.", min=2)]
Anywhere = Annotated[bool, typer.Option("--anywhere", help="On the way there, start on any branch.")]
Change = Annotated[float | None, typer.Option(help="What a change of branch on the way costs, in rad^2.")]
Apart = Annotated[bool, typer.Option("--self-collision", help="Links stay apart from each other, too.")]
Out = Annotated[Path | None, typer.Option(help="Folder for picture, curves and figures. Default: runs/explore-TIME.")]
WRITTEN = ("self_motion.*", "law.npz", "summary.json")


def explore(
    robot: options.RobotName,
    frame: options.FrameName = None,
    at: At = "",
    kind: Kind = "pose",
    sphere: options.Spheres = None,
    floor: options.Floor = None,
    self_collision: Apart = False,
    rates: Rates = None,
    seeds: Seeds = 20,
    through: Through = False,
    to: To = None,
    points: Points = 25,
    anywhere: Anywhere = False,
    change: Change = None,
    margin: options.Margin = 0.02,
    out: Out = None,
    force: options.Force = False,
) -> None:
    """Show all rates that serve a frame, the self-motion of the arm there, and its best configuration.

    Example: [bold]wbc explore panda --kind pose --sphere 0.3,0.3,0.5,0.1[/bold]
    """
    import numpy as np
    import pinocchio as pin
    from rich.table import Table

    from wbc import robots, tasks, validation
    from wbc.api import Stack
    from wbc.cli.analysis.advise import configuration_of
    from wbc.cli.console import out as console
    from wbc.cli.planning import comma_numbers, given_obstacles, tip_frame
    from wbc.errors import ShapeError
    from wbc.explore import Explorer
    from wbc.explore.pictures import save_pieces
    from wbc.tasks.frames import frame_pose

    machine = robots.load(robot)
    folder = run_folder(out, "explore", WRITTEN, force, clear=False, made=False)
    name = machine.check_frame("frame", frame) if frame else tip_frame(machine, None)
    q = np.array(configuration_of(machine, at))
    stack = Stack(machine, dt=0.01)
    chosen: Any = validation.one_of("kind", kind, ("pose", "position", "orientation"))
    stack.add(tasks.EndEffector(name, kind=chosen), name="hand")
    for label, one in given_obstacles(sphere, floor).items():
        stack.add(tasks.Obstacle(one.shape, margin=margin, pose=one.pose), name=label)
    if self_collision:
        stack.add(tasks.SelfCollision(margin=margin), name="links")
    explorer = Explorer(stack, q)
    wanted = None if rates is None else comma_numbers("rates", rates)
    end = None if to is None else comma_numbers("to", to)
    if end is not None and len(end) != 3:
        raise ShapeError("to", to, "expected X,Y,Z")
    found = explorer.tick(q, wanted if wanted is not None else np.zeros(6 if kind == "pose" else 3))
    console().print(f"{machine.name}, {kind} of {name}: rank {found.space.rank}, {found.space.span - 1} self-motions")
    table = Table(header_style="bold", box=None, pad_edge=False)
    for head in ("joint", *found.optima, "least", "largest"):
        table.add_column(head, justify="right")
    for k, joint in enumerate(machine.dof_names):
        cells = [*(v[k] for v in found.optima.values()), found.lower[k], found.upper[k]]
        table.add_row(joint, *(f"{x:.4f}" for x in cells))
    console().print(table)
    figures: dict[str, Any] = {"robot": machine.name, "frame": name, "kind": kind, "rank": found.space.rank,
                               "self_motions": found.space.span - 1}  # fmt: skip
    if found.space.span > 1:
        pieces = explorer.pieces(q, seeds=seeds, through=through)
        best, room = explorer.best(pieces)
        for number, piece in enumerate(pieces, 1):
            kept = sum(not text for text in piece.broken)
            how = "closed" if piece.closed else f"from {piece.ends[0]} to {piece.ends[1]}"
            console().print(
                f"piece {number}: {len(piece.q)} configurations, {kept} within all limits, {how}", highlight=False
            )
            for a, b, what in piece.windows:
                console().print(f"  {a} to {b}: {what}", highlight=False)
        console().print(f"farthest from limits: {room:.3f} of half a range at " + ",".join(f"{x:.4f}" for x in best))
        figures["pieces"] = [{"count": len(p.q), "closed": p.closed, "ends": p.ends, "free": p.free,
                              "windows": p.windows} for p in pieces]  # fmt: skip
        figures["best"] = {"q": best.tolist(), "share": room}
        curves: dict[str, Any] = {f"piece{k}": p.q for k, p in enumerate(pieces, 1)}
    with filled(folder, WRITTEN) as fresh:
        if found.space.span > 1:
            np.savez_compressed(fresh / "self_motion.npz", **curves)
            save_pieces(machine, pieces, fresh / "self_motion.png", best)
        _write(fresh, figures)
    if end is not None:
        pose = frame_pose(machine, name, q)
        places = [pose.translation + s * (end - pose.translation) for s in np.linspace(0.0, 1.0, points)]
        targets = places if kind == "position" else [pin.SE3(pose.rotation, place) for place in places]
        path = explorer.along({"hand": targets}, q, anywhere=anywhere, change=change)
        law = path.law(np.minimum(machine.limits.velocity, 10.0), np.minimum(machine.limits.acceleration, 10.0))
        _, stopped = explorer.step_by_step({"hand": targets}, q)
        console().print(
            f"along: {path.nodes} configurations compared, {len(path.changes)} changes, {law.duration:.3f} s; "
            f"step by step {stopped or 'done'}"
        )
        figures["along"] = {"cost": path.cost, "nodes": path.nodes, "changes": path.changes, "duration": law.duration,
                            "step_by_step": stopped}  # fmt: skip
        with filled(folder) as fresh:
            law.save(fresh / "law.npz")
            _write(fresh, figures)
    console().print(str(folder))


def _write(folder: Path, figures: dict[str, Any]) -> None:
    (folder / "summary.json").write_text(json.dumps(figures, indent=1) + "\n")
