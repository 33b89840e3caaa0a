"""Certificates of ``wbc analyse``: how they are made, resumed, printed and written."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.markup import escape

from wbc.analysis import Certificate, ExactModel, Rows, Screened, candidate_rows, certify, screen
from wbc.cli.console import out, progress_bar
from wbc.errors import RobotFileError


@dataclass(frozen=True)
class Subdivision:
    """Options of certificates: how many minutes each may take, and the folder of their states."""

    minutes: float
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
    model: ExactModel, robot: str, name: str, task: Sequence[Rows], rows: Sequence[Rows], how: Subdivision
) -> Certificate:
    """The certificate of one set, with a progress bar, printed."""
    with progress_bar() as bar:
        shown = bar.add_task(f"{name}, decided", total=1.0)
        found = certify(
            model,
            task,
            rows,
            minutes=how.minutes,
            state=how.state(robot, name),
            progress=lambda part: bar.update(shown, completed=part),
        )
    console = out()
    for line in lines(found):
        console.print(f"  {escape(line)}", soft_wrap=True)
    return found


def lines(found: Certificate) -> list[str]:
    """A certificate as text."""
    tube = f"sigma_min(J_T) < {found.eps:.4g} ({found.eps / found.peak:.3g} of its maximum)" if found.peak else ""
    if found.verdict == "incomplete" and found.witness is not None:
        q = ", ".join(f"{x:.9g}" for x in found.witness.q)
        task, every = found.witness.task[-1], found.witness.augmented[-1]
        return [
            f"certificate  incomplete outside the tube {tube}: witness q = {q}",
            f"             smallest singular value: task {task:.4g}, with constraints {every:.1g}",
        ]
    if found.verdict == "complete":
        where = "everywhere" if found.everywhere else f"outside the tube {tube}"
        said = [f"certificate  complete {where}"]
    else:
        said = [f"certificate  undecided: {found.left:.3g} of the volume is left; the rest is complete outside {tube}"]
    counts = found.counts
    joints = ", ".join(f"q{k + 1}" for k in found.joints) or "none"
    said.append(
        f"             {counts.boxes:.0f} boxes of {joints} ({found.symmetries} symmetries): full rank on "
        f"{counts.regular:.0f}, in the tube {counts.tube:.0f}, undecided {counts.undecided:.0f}; {found.seconds:.1f} s"
    )
    return said


def record(found: Certificate) -> dict[str, Any]:
    """A certificate as data."""
    witness = found.witness
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
        "witness": None if witness is None else {"q": witness.q.tolist(), "task": witness.task.tolist()},
    }


def winner(model: ExactModel, robot: str, task: Sequence[Rows], most: int) -> Screened | None:
    """The best conditioned of the smallest sets that a numeric screen leaves, printed."""
    with progress_bar() as bar:
        shown = bar.add_task("screen", total=1.0)
        found = screen(
            model, task, candidate_rows(robot), most=most, progress=lambda part: bar.update(shown, completed=part)
        )
    console = out()
    if not found:
        console.print(f"screen: no set of {most} or fewer constraints is complete")
        return None
    console.print(f"screen: {len(found)} sets of {len(found[0].names)} constraints without a witness; the best:")
    for one in found[:5]:
        console.print(f"  {', '.join(one.names)}: least sigma_min(J_R) / sigma_min(J_T) found {one.ratio:.3g}")
    return found[0]
