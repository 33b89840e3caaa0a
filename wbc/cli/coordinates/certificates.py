"""Certificates of ``wbc coordinates analyse``: how they are made and resumed."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from pathlib import Path

from rich.progress import TaskID

from wbc.analysis import (
    ExactModel,
    JointBlock,
    RankCertificate,
    Rows,
    Screened,
    TreeCertificate,
    candidate_rows,
    certify,
    certify_blocks,
)
from wbc.analysis.certificates.screen import screen
from wbc.cli.console import progress_bar, say
from wbc.coordinates.arms.published_trees import TreeSet
from wbc.errors import RobotFileError


def state_file(folder: Path | None, robot: str, name: str) -> Path | None:
    """File of the state of one set's certificate; None without a folder.

    Raises:
        RobotFileError: the folder cannot be made.
    """
    if folder is None:
        return None
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RobotFileError("resume", str(folder), f"cannot be made: {error.strerror}") from error
    return folder / (re.sub(r"\W+", "-", f"{robot} {name}") + ".npz")


def certified(
    model: ExactModel, name: str, task: Sequence[Rows], rows: Sequence[Rows], state: Path | None, minutes: float
) -> RankCertificate:
    """The certificate of one set, with a progress bar."""
    with progress_bar() as bar:
        shown = bar.add_task(f"{name}, decided", total=1.0)
        return certify(
            model,
            task,
            rows,
            minutes=minutes,
            state=state,
            progress=lambda part: bar.update(shown, completed=part),
        )


def certified_tree(model: ExactModel, name: str, one: TreeSet, state: Path | None, minutes: float) -> TreeCertificate:
    """The certificate of one set of a tree, each block with its own progress bar."""
    with progress_bar() as bar:
        shown: dict[str, TaskID] = {}

        def within(block: JointBlock, part: float) -> None:
            if str(block) not in shown:
                shown[str(block)] = bar.add_task(f"{name}, {block}, decided", total=1.0)
            bar.update(shown[str(block)], completed=part)

        return certify_blocks(model, one.task, one.constraints, minutes=minutes, state=state, progress=within)


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
    if time.monotonic() - began > 60.0 * minutes:
        say(f"screen: ended after {minutes:g} min, before all sets were looked at")
    elif not found:
        say(f"screen: no set of {most} or fewer constraints is complete")
    if not found:
        return None
    say(f"screen: {len(found)} sets of {len(found[0].names)} constraints without a witness; the best:")
    for one in found[:5]:
        say(f"  {', '.join(one.names)}: least sigma_min(J_R) / sigma_min(J_T) found {one.ratio:.3g}")
    return found[0]
