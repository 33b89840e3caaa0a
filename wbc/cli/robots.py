"""``wbc robots``: robots by name, one of them, and its pairs of links."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.markup import escape

from wbc.cli.console import OutputError, data, out, progress_bar, say, table, tell
from wbc.cli.reading import Option
from wbc.cli.scene import RobotName
from wbc.errors import RangeError

if TYPE_CHECKING:
    from wbc.robot import Robot
    from wbc.robot.pairs.collision_pairs import SelfPairs
    from wbc.shapes import PlacedShape

#: Random configurations, where nobody says how many
SAMPLES = 10000


@dataclass(frozen=True)
class Names:
    """List the robots that load by name."""

    match: Annotated[str, Option("Only names that contain this text.", placed=True)] = ""
    all: Annotated[bool, "Also the files that cannot be loaded, and why."] = False

    def run(self) -> None:
        from wbc import robots

        chosen = [
            recipe
            for recipe in robots.table()
            if self.match.lower() in recipe.name.lower() and (self.all or not recipe.problem)
        ]
        if not chosen:
            robots.load(self.match)  # not in the table: raises with the nearest names, unless it is a file
        rows = (
            (
                one.name,
                one.base,
                f"[red]does not load: {escape(one.problem)}[/red]" if one.problem else escape(one.about),
            )
            for one in chosen
        )
        out().print(table(("name", "base", "about"), rows, "Robots", ("base", "about")))
        tell(
            f"{len(chosen)} robots; `wbc robots show NAME` shows one. A URDF or MJCF file works in the place of a name."
        )
        keys = ("name", "base", "about", "problem")
        data([{**{key: getattr(one, key) for key in keys}, "frames": dict(one.frames)} for one in chosen])


@dataclass(frozen=True)
class RobotShow:
    """Show a robot: joints, limits, frames, shapes and where the numbers come from."""

    robot: RobotName
    base: Annotated[str | None, "fixed, floating, planar or differential. Default: that of the table."] = None
    frames: Annotated[bool, "List the frames."] = True
    shapes: Annotated[str, "Of the links: auto, description, exact, fit, spheres, convex or none."] = "auto"

    def run(self) -> None:
        from wbc import robots

        robot = robots.load(self.robot, base=self.base, shapes=self.shapes)
        out().print(
            f"[bold]{robot.name}[/bold]: {robot.nv} degrees of freedom, {robot.base} base, "
            f"characteristic length {robot.characteristic_length:.3g} m"
        )
        if robot.source:
            say(f"read from {robot.source}")
        heads = ("joint", "unit", "lower", "upper", "velocity", "acceleration", "effort", "neutral")
        out().print(table(heads, _joints(robot)))
        names = robot.dof_names
        couplings = (f"{names[c.follower]} = {c.ratio:g} {names[c.leader]} + {c.offset:g}" for c in robot.couplings)
        said = {
            "coupled": ", ".join(couplings),
            "loops": ", ".join(loop.name for loop in robot.loops.loops) if robot.loops else "",
            "motors": ", ".join(robot.motor_names) if robot.passive else "",
            "roles": ", ".join(f"{role}: {frame}" for role, frame in robot.frames.items()),
            "shapes": ", ".join(f"{link} {len(group)}" for link, group in robot.shapes.items()),
            **{f"{key}:": note for key, note in robot.notes.items()},
            "frames": ", ".join(robot.frame_names) if self.frames else "",
        }
        for name, text in said.items():
            if text:
                out().print(
                    f"[bold]{name:8}[/bold] {escape(text)}"
                    if name[-1] != ":"
                    else f"[bold]{name[:-1]}[/bold]: {escape(text)}",
                    soft_wrap=True,
                )
        data(_known(robot))


@dataclass(frozen=True)
class RobotPairs:
    """Show which links must not touch each other, and why others may.

    Their shapes are shown, too. A file of --save may be edited, and is shown with --pairs.
    """

    robot: RobotName
    base: Annotated[str | None, "fixed, floating, planar or differential. Default: that of the table."] = None
    shapes: Annotated[str, "Of the links: auto, description, exact, fit, spheres, convex or none."] = "auto"
    samples: Annotated[int | None, f"Random configurations to look at. Default: {SAMPLES}."] = None
    seed: Annotated[int, "Of the random configurations."] = 0
    clearance: Annotated[float, "Links this close count as touching [m]."] = 0.0
    srdf: Annotated[Path | None, "SRDF file. Default: the table's, if any."] = None
    pairs: Annotated[Path | None, "Show the pairs in this file."] = None
    save: Annotated[Path | None, "Write the pairs to this file, to be edited."] = None
    force: Annotated[bool, "Write over a file that is there."] = False

    def run(self) -> None:
        from wbc import robots
        from wbc.robot.pairs.collision_pairs import REASONS

        robot = robots.load(self.robot, base=self.base, shapes=self.shapes)
        self._check()
        found = robots.read_self_pairs(self.pairs, robot) if self.pairs is not None else self._found(robot)
        shapes = (
            ("" if k else link, type(placed.shape).__name__.lower(), _size(placed), f"{1e3 * placed.excess:.1f}")
            for link, group in robot.shapes.items()
            for k, placed in enumerate(group)
        )
        out().print(table(("link", "shape", "size, mm", "stands out by, mm"), shapes, "Shapes", ("shape",)))
        rows = []
        for pair in sorted(found.pairs, key=lambda pair: (not pair.keep, list(REASONS).index(pair.reason))):
            distance = "-" if pair.distance is None else f"{1e3 * pair.distance:.1f}"
            reason = f"{pair.reason}: {escape(pair.detail)}" if pair.detail else pair.reason
            rows.append((*pair.links, "[green]kept[/green]" if pair.keep else "dropped", reason, distance))
        heads = ("link", "and", "", "reason", "least distance, mm")
        out().print(table(heads, rows, "Pairs of links", heads[:4]))
        for reason, count in found.counts().items():
            out().print(f"{count:5d}  [bold]{reason}[/bold]  {REASONS[reason]}", soft_wrap=True)
        how = f"{found.samples} configurations, seed {found.seed}, clearance {1e3 * found.clearance:g} mm"
        out().print(f"[bold]{len(found.kept)} of {len(found.pairs)} pairs kept[/bold] ({how})")
        if found.unknown:
            say(f"the SRDF file also names {', '.join(found.unknown)}")
        if self.save is not None:
            robots.save_self_pairs(found, self.save)
            tell(f"written to {self.save}; keep may be edited there")

    def _check(self) -> None:
        """Refuses, before a long search, what could not be done after it."""
        if self.pairs is not None and (self.samples is not None or self.srdf is not None):
            raise RangeError("pairs", str(self.pairs), "a file is shown as it is: leave out --samples and --srdf")
        if self.save is not None and self.save.exists() and not self.force:
            reason = "there is such a file, perhaps edited by hand; choose another, or use --force"
            raise OutputError("save", str(self.save), reason)
        if self.save is not None and not self.save.parent.is_dir():
            raise OutputError("save", str(self.save), "there is no such folder")

    def _found(self, robot: Robot) -> SelfPairs:
        from wbc import robots

        with progress_bar() as bar:
            task = bar.add_task("looking for links that touch")
            return robots.find_self_pairs(
                robot,
                srdf=self.srdf or "auto",
                samples=SAMPLES if self.samples is None else self.samples,
                seed=self.seed,
                clearance=self.clearance,
                progress=lambda done, total: bar.update(task, completed=done, total=total),
            )


def _known(robot: Robot) -> dict[str, Any]:
    """What there is to know of a robot, limits by degree of freedom."""
    keys = ("name", "base", "source", "nq", "nv")
    return {
        **{key: getattr(robot, key) for key in keys},
        "dofs": list(robot.dof_names),
        "units": list(robot.dof_units),
        "limits": {field.name: getattr(robot.limits, field.name).tolist() for field in fields(robot.limits)},
        "neutral": robot.neutral.tolist(),
        "roles": dict(robot.frames),
        "frames": list(robot.frame_names),
        "shapes": {link: len(group) for link, group in robot.shapes.items()},
        "notes": dict(robot.notes),
    }


def _joints(robot: Robot) -> list[tuple[str, ...]]:
    limits, rows = robot.limits, []
    columns = (limits.position_lower, limits.position_upper, limits.velocity, limits.acceleration, limits.effort)
    for k, (dof, unit) in enumerate(zip(robot.dof_names, robot.dof_units, strict=True)):
        place = int(robot.position_index[k])
        numbers = [*(float(column[k]) for column in columns), robot.neutral[place] if place >= 0 else math.nan]
        rows.append((dof, unit, *(f"{x:.4g}" if math.isfinite(x) else "-" for x in numbers)))
    return rows


def _size(placed: PlacedShape) -> str:
    import numpy as np

    out = []
    for name, value in ((field.name, getattr(placed.shape, field.name)) for field in fields(placed.shape)):
        if isinstance(value, np.ndarray):
            out.append(f"{len(value)} {name}")
        else:
            size = value if isinstance(value, tuple) else (value,)
            out.append(f"{name} {' x '.join(f'{1e3 * x:.1f}' for x in size)}")
    return ", ".join(out)
