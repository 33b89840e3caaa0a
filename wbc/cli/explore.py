"""``wbc ik explore``: what else a robot could have done at a configuration."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from wbc.cli.scene import SceneOptions
from wbc.errors import ShapeError

if TYPE_CHECKING:
    from wbc.explore import Explorer
    from wbc.robot import Robot
    from wbc.validation import Array

WRITTEN = ("self_motion.*", "law.npz", "summary.json")
#: Rates and accelerations of the law where the robot has no limits [rad/s, rad/s^2]
MOST = 10.0


@dataclass(frozen=True)
class Explore(SceneOptions):
    """Show all rates that serve a frame, and the self-motion of the arm.

    With its best configuration, that which is farthest from limits.

    Example: wbc ik explore panda --kind pose --sphere 0.3,0.3,0.5,0.1
    """

    PANEL: ClassVar[str] = "What it shows"
    kind: Annotated[Literal["pose", "position", "orientation"], "What the frame holds."] = "pose"
    rates: Annotated[
        tuple[float, ...] | None, "Rates of these rows with commas [m/s, rad/s]. Default: it stands still."
    ] = None
    self_collision: Annotated[bool, "Links stay apart from each other, too."] = False
    seeds: Annotated[int, "Random configurations that pieces are searched from."] = 20
    through: Annotated[bool, "Trace beyond limits, which are windows then."] = False
    to: Annotated[str | None, "X,Y,Z: where the frame goes straight to, resolved as a whole [m]."] = None
    points: Annotated[int, "Targets on the way there, 2 or more."] = 25
    anywhere: Annotated[bool, "On the way there, start on any branch."] = False
    change: Annotated[float | None, "What a change of branch on the way costs [rad^2]. Default: never."] = None
    out: Annotated[Path | None, "Folder for picture, curves and figures. Default: runs/explore-TIME."] = None
    force: Annotated[bool, "Write into a folder that has such a run."] = False

    def run(self) -> None:
        import numpy as np

        from wbc import robots, tasks, validation
        from wbc.api import Stack
        from wbc.cli.console import out, say, table, write_json
        from wbc.cli.folders import filled, run_folder
        from wbc.cli.reading import numbers
        from wbc.cli.scene import configuration, tip_frame
        from wbc.explore import Explorer

        validation.integer("seeds", self.seeds, 0)
        machine = robots.load(self.robot)
        name, q = tip_frame(machine, self.frame), configuration(machine, "start", self.start)
        stack = Stack(machine, dt=0.01)
        stack.add(tasks.EndEffector(name, kind=self.kind), name="hand")
        for label, one in self.obstacles().items():
            stack.add(tasks.Obstacle(one.shape, margin=self.margin, pose=one.pose), name=label)
        if self.self_collision:
            stack.add(tasks.SelfCollision(margin=self.margin), name="links")
        end = None if self.to is None else numbers("to", self.to)
        if end is not None and len(end) != 3:
            raise ShapeError("to", self.to, "expected X,Y,Z")
        folder = run_folder(self.out, "explore", WRITTEN, self.force, clear=False)
        explorer = Explorer(stack, q)
        found = explorer.tick(q, np.zeros(6 if self.kind == "pose" else 3) if self.rates is None else self.rates)
        rank, free = found.space.rank, found.space.span - 1
        say(f"{machine.name}, {self.kind} of {name}: rank {rank}, {free} self-motions")
        columns = [*found.optima.values(), found.lower, found.upper]
        rows = ((joint, *(f"{v[k]:.4f}" for v in columns)) for k, joint in enumerate(machine.dof_names))
        out().print(table(("joint", *found.optima, "least", "largest"), rows))
        figures = {"robot": machine.name, "frame": name, "kind": self.kind, "rank": rank, "self_motions": free}
        with filled(folder, WRITTEN) as fresh:
            if free:
                figures |= self._pieces(machine, explorer, q, fresh)
            write_json(fresh / "summary.json", figures)
        if end is not None:
            with filled(folder) as fresh:
                figures |= {"along": self._along(machine, explorer, name, q, end, fresh)}
                write_json(fresh / "summary.json", figures)
        say(folder)

    def _pieces(self, machine: Robot, explorer: Explorer, q: Array, fresh: Path) -> dict[str, Any]:
        """The self-motion, traced, drawn and written."""
        import numpy as np

        from wbc.cli.console import say
        from wbc.explore.pictures import save_pieces

        pieces = explorer.pieces(q, seeds=self.seeds, through=self.through)
        best, room = explorer.best(pieces)
        for number, piece in enumerate(pieces, 1):
            kept = sum(not text for text in piece.broken)
            how = "closed" if piece.closed else f"from {piece.ends[0]} to {piece.ends[1]}"
            say(f"piece {number}: {len(piece.q)} configurations, {kept} within all limits, {how}")
            for a, b, what in piece.windows:
                say(f"  {a} to {b}: {what}")
        say(f"farthest from limits: {room:.3f} of half a range at " + ",".join(f"{x:.4f}" for x in best))
        curves: dict[str, Any] = {f"piece{k}": p.q for k, p in enumerate(pieces, 1)}
        np.savez_compressed(fresh / "self_motion.npz", **curves)
        save_pieces(machine, pieces, fresh / "self_motion.png", best)
        told = [
            {"count": len(p.q), "closed": p.closed, "ends": p.ends, "free": p.free, "windows": p.windows}
            for p in pieces
        ]
        return {"pieces": told, "best": {"q": best.tolist(), "share": room}}

    def _along(
        self, machine: Robot, explorer: Explorer, name: str, q: Array, end: Array, fresh: Path
    ) -> dict[str, Any]:
        """Straight to a place, resolved as a whole, beside step by step."""
        import numpy as np

        from wbc import validation
        from wbc.cli.console import say
        from wbc.multibody import pin

        validation.integer("points", self.points, 2)
        pose = machine.pose(q, name)
        places = [pose.translation + s * (end - pose.translation) for s in np.linspace(0.0, 1.0, self.points)]
        targets = places if self.kind == "position" else [pin.SE3(pose.rotation, place) for place in places]
        path = explorer.along({"hand": targets}, q, anywhere=self.anywhere, change=self.change)
        law = path.law(np.minimum(machine.limits.velocity, MOST), np.minimum(machine.limits.acceleration, MOST))
        _, stopped = explorer.step_by_step({"hand": targets}, q)
        say(
            f"along: {path.nodes} configurations compared, {len(path.changes)} changes, {law.duration:.3f} s; "
            f"step by step {stopped or 'done'}"
        )
        law.save(fresh / "law.npz")
        told = {"cost": path.cost, "nodes": path.nodes, "changes": path.changes, "duration": law.duration}
        return {**told, "step_by_step": stopped}
