"""Certificates of ``wbc analyse``: how they are made, resumed, printed and written."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.progress import TaskID

from wbc.analysis import (
    ExactModel,
    JointBlock,
    NumericWitness,
    RankCertificate,
    Rows,
    Screened,
    TreeCertificate,
    candidate_rows,
    certify,
    certify_blocks,
)
from wbc.analysis.certificates.screen import screen
from wbc.cli.console import out, progress_bar
from wbc.coordinates.arms.published_trees import TreeSet
from wbc.errors import RobotFileError


@dataclass(frozen=True)
class Subdivision:
    """Options of certificates: the folder of their states."""

    folder: Path | None

    def state(self, robot: str, name: str) -> Path | None:
        """File of one set.

        Raises:
            RobotFileError: the folder cannot be made.
        """
        if self.folder is None:
            return None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RobotFileError("resume", str(self.folder), f"cannot be made: {error.strerror}") from error
        return self.folder / (re.sub(r"\W+", "-", f"{robot} {name}") + ".npz")


def certified(
    model: ExactModel,
    robot: str,
    name: str,
    task: Sequence[Rows],
    rows: Sequence[Rows],
    how: Subdivision,
    minutes: float,
) -> RankCertificate:
    """The certificate of one set, with a progress bar."""
    with progress_bar() as bar:
        shown = bar.add_task(f"{name}, decided", total=1.0)
        return certify(
            model,
            task,
            rows,
            minutes=minutes,
            state=how.state(robot, name),
            progress=lambda part: bar.update(shown, completed=part),
        )


def show_certificate(found: RankCertificate) -> None:
    """Printed."""
    console = out()
    for line in lines(found):
        console.print(f"  {escape(line)}", soft_wrap=True)


def certified_tree(
    model: ExactModel, robot: str, name: str, one: TreeSet, how: Subdivision, minutes: float
) -> TreeCertificate:
    """The certificate of one set of a tree, each block with its own progress bar, printed."""
    with progress_bar() as bar:
        shown: dict[str, TaskID] = {}

        def within(block: JointBlock, part: float) -> None:
            if str(block) not in shown:
                shown[str(block)] = bar.add_task(f"{name}, {block}, decided", total=1.0)
            bar.update(shown[str(block)], completed=part)

        state = how.state(robot, name)
        found = certify_blocks(model, one.task, one.constraints, minutes=minutes, state=state, progress=within)
    console = out()
    where = {True: " everywhere", False: " outside the tubes of the blocks"}[found.everywhere]
    said = {"complete": where, "undecided": f": {found.left:.3g} of the volume is left", "incomplete": ""}
    console.print(f"  certificate  {found.verdict}{said[found.verdict]}, by blocks; {found.seconds:.1f} s by the clock")
    for block, own in found.blocks:
        console.print(f"  block    {escape(str(block))}", soft_wrap=True)
        for line in lines(own):
            console.print(f"    {escape(line)}", soft_wrap=True)
    if found.witness is not None:
        for line in _witness(found.witness):
            console.print(f"  {escape(line)}", soft_wrap=True)
        console.print(f"  {escape(str(found.lost))} loses rank; the tube is sigma_min(J_T) < {found.eps:.4g}")
    return found


def _witness(found: NumericWitness) -> list[str]:
    q = ", ".join(f"{x:.9g}" for x in found.q)
    task = f"task {found.task[-1]:.4g}, " if len(found.task) else ""
    return [
        f"witness q = {q}",
        f"             smallest singular value: {task}with constraints {found.augmented[-1]:.1g}",
    ]


def lines(found: RankCertificate) -> list[str]:
    """A certificate as text."""
    tube = f"sigma_min(J_T) < {found.eps:.4g} ({found.eps / found.peak:.3g} of its maximum)" if found.peak else ""
    if found.verdict == "incomplete" and found.witness is not None:
        first, second = _witness(found.witness)
        outside = f" outside the tube {tube}" if found.peak else ""
        return [f"certificate  incomplete{outside}: {first}", second]
    if found.verdict == "complete":
        where = "everywhere" if found.everywhere else f"outside the tube {tube}"
        said = [f"certificate  complete {where}"]
    else:
        rest = f"complete outside {tube}" if found.peak else "complete"
        said = [f"certificate  undecided: {found.left:.3g} of the volume is left; the rest is {rest}"]
    counts = found.counts
    joints = ", ".join(f"q{k + 1}" for k in found.joints) or "none"
    said.append(
        f"             {counts.boxes:.0f} boxes of {joints} ({found.symmetries} symmetries): full rank on "
        f"{counts.regular:.0f}, in the tube {counts.tube:.0f}, undecided {counts.undecided:.0f}; "
        f"{found.seconds:.1f} s by the clock"
    )
    return said


def _witness_record(found: NumericWitness | None) -> dict[str, Any] | None:
    """A witness as data, if there is one."""
    return None if found is None else {"q": found.q.tolist(), "task": found.task.tolist()}


def record(found: RankCertificate) -> dict[str, Any]:
    """A certificate as data."""
    return {
        "verdict": found.verdict,
        "eps": found.eps,
        "peak": found.peak,
        "everywhere": found.everywhere,
        "left": found.left,
        "boxes": found.counts.boxes,
        "joints": [f"q{k + 1}" for k in found.joints],
        "symmetries": found.symmetries,
        "seconds": found.seconds,
        "witness": _witness_record(found.witness),
    }


def record_tree(found: TreeCertificate) -> dict[str, Any]:
    """A certificate of a tree as data."""
    return {
        "verdict": found.verdict,
        "everywhere": found.everywhere,
        "left": found.left,
        "eps": found.eps,
        "seconds": found.seconds,
        "blocks": [{"block": str(block), **record(own)} for block, own in found.blocks],
        "lost": None if found.lost is None else str(found.lost),
        "witness": _witness_record(found.witness),
    }


def winner(model: ExactModel, robot: str, task: Sequence[Rows], most: int, minutes: float) -> Screened | None:
    """Within the minutes the best conditioned of the smallest sets that a numeric screen leaves, printed."""
    with progress_bar() as bar:
        shown = bar.add_task("screen", total=1.0)
        began = time.monotonic()
        found = screen(
            model,
            task,
            candidate_rows(robot),
            most=most,
            minutes=minutes,
            progress=lambda part: bar.update(shown, completed=part),
        )
    console = out()
    if time.monotonic() - began > 60.0 * minutes:
        console.print(f"screen: ended after {minutes:g} min, before all sets were looked at")
        if not found:
            return None
    if not found:
        console.print(f"screen: no set of {most} or fewer constraints is complete")
        return None
    console.print(f"screen: {len(found)} sets of {len(found[0].names)} constraints without a witness; the best:")
    for one in found[:5]:
        console.print(f"  {', '.join(one.names)}: least sigma_min(J_R) / sigma_min(J_T) found {one.ratio:.3g}")
    return found[0]
