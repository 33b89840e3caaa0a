"""``wbc robot NAME --collisions``: shapes of the links, and which links must not touch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from wbc import robots
from wbc.cli.console import OutputError, err, out
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.robot.pairs.collision_pairs import REASONS, LinkPair, SelfPairs
from wbc.shapes import Box, Convex, PlacedShape, Sphere

#: Random configurations, where nobody says how many.
SAMPLES = 10000


@dataclass(frozen=True)
class Collisions:
    """What to show: pairs found anew, or those of a file.

    Attributes:
        samples, seed, clearance, srdf: see ``wbc.robots.find_self_pairs``; samples None: :data:`SAMPLES`.
        pairs: file to show instead.
        save: file to write, ``force`` over one that is there.
    """

    samples: int | None = None
    seed: int = 0
    clearance: float = 0.0
    srdf: Path | None = None
    pairs: Path | None = None
    save: Path | None = None
    force: bool = False


def show(robot: Robot, wanted: Collisions) -> None:
    """Prints the shapes and the pairs of a robot, and writes the pairs to a file if asked.

    Raises:
        OutputError: the file is there already, or cannot be; RangeError: a file to show, and what to look for
            instead; WbcError: see ``wbc.robots.find_self_pairs`` and ``read_self_pairs``.
    """
    _check(wanted)
    found = robots.read_self_pairs(wanted.pairs, robot) if wanted.pairs is not None else _found(robot, wanted)
    console = out()
    console.print(_shapes(robot))
    console.print(_pairs(found))
    for reason, count in found.counts().items():
        console.print(f"{count:5d}  [bold]{reason}[/bold]  {REASONS[reason]}", soft_wrap=True)
    how = f"{found.samples} configurations, seed {found.seed}, clearance {1e3 * found.clearance:g} mm"
    console.print(f"[bold]{len(found.kept)} of {len(found.pairs)} pairs kept[/bold] ({how})")
    if found.unknown:
        console.print(f"the SRDF file also names {', '.join(map(escape, found.unknown))}", soft_wrap=True)
    if wanted.save is not None:
        robots.save_self_pairs(found, wanted.save)
        err().print(f"written to {escape(str(wanted.save))}; keep may be edited there", soft_wrap=True)


def _check(wanted: Collisions) -> None:
    """Refuses, before a long search, what could not be done after it."""
    if wanted.pairs is not None and (wanted.samples is not None or wanted.srdf is not None):
        raise RangeError("pairs", str(wanted.pairs), "a file is shown as it is: leave out --samples and --srdf")
    if wanted.save is None:
        return
    if wanted.save.exists() and not wanted.force:
        reason = "there is such a file, perhaps edited by hand; choose another, or use --force"
        raise OutputError("save", str(wanted.save), reason)
    if not wanted.save.parent.is_dir():
        raise OutputError("save", str(wanted.save), "there is no such folder")


def _found(robot: Robot, wanted: Collisions) -> SelfPairs:
    """The pairs, with a bar on standard error while they are looked for."""
    samples = SAMPLES if wanted.samples is None else wanted.samples
    console = err()
    bar = Progress(
        TextColumn("looking for links that touch"),
        BarColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
        refresh_per_second=5,
    )
    with bar:
        task = bar.add_task("")
        return robots.find_self_pairs(
            robot,
            srdf="auto" if wanted.srdf is None else wanted.srdf,
            samples=samples,
            seed=wanted.seed,
            clearance=wanted.clearance,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )


def _shapes(robot: Robot) -> Table:
    rows = Table(title="Shapes", title_justify="left", header_style="bold", box=None, pad_edge=False)
    rows.add_column("link", no_wrap=True)
    rows.add_column("shape")
    rows.add_column("size, mm", justify="right")
    rows.add_column("stands out by, mm", justify="right")
    for link, group in robot.shapes.items():
        for placed in group:
            rows.add_row(link, type(placed.shape).__name__.lower(), _size(placed), f"{1e3 * placed.excess:.1f}")
            link = ""
    return rows


def _size(placed: PlacedShape) -> str:
    shape = placed.shape
    if isinstance(shape, Sphere):
        return f"radius {1e3 * shape.radius:.1f}"
    if isinstance(shape, Box):
        return " x ".join(f"{1e3 * side:.1f}" for side in shape.size)
    if isinstance(shape, Convex):
        return f"{len(shape.points)} corners"
    return f"radius {1e3 * shape.radius:.1f}, length {1e3 * shape.length:.1f}"


def _pairs(found: SelfPairs) -> Table:
    rows = Table(title="Pairs of links", title_justify="left", header_style="bold", box=None, pad_edge=False)
    rows.add_column("link", no_wrap=True)
    rows.add_column("link", no_wrap=True)
    rows.add_column("")
    rows.add_column("reason")
    rows.add_column("least distance, mm", justify="right")
    for pair in sorted(found.pairs, key=lambda pair: (not pair.keep, list(REASONS).index(pair.reason))):
        distance = "-" if pair.distance is None else f"{1e3 * pair.distance:.1f}"
        kept = "[green]kept[/green]" if pair.keep else "dropped"
        rows.add_row(*pair.links, kept, _reason(pair), distance)
    return rows


def _reason(pair: LinkPair) -> str:
    return f"{pair.reason}: {escape(pair.detail)}" if pair.detail else pair.reason
