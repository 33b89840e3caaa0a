"""Answers of inverse kinematics to targets, in words, as data, and as a CSV or npz file."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wbc.ik.hindrance import Hindrance
from wbc.ik.solution import Solution
from wbc.robot import Robot

SUFFIXES = (".csv", ".npz")


@dataclass(frozen=True, eq=False)
class TargetAnswer:
    """A configuration for a target; both, and the branches of a target, are counted from 1."""

    target: int
    branch: int
    solution: Solution
    oriented: bool
    why: Hindrance | None = None

    @property
    def solved(self) -> bool:
        """Whether the target is reached."""
        return self.solution.solved

    @property
    def off(self) -> tuple[float, float]:
        """Distance [m] and angle [rad] from the target; 0 for an angle that nobody asked for."""
        hand = self.solution.residuals["hand"]
        return hand.norm("m"), hand.norm("rad") if self.oriented else 0.0

    @property
    def binding(self) -> str:
        """Rows and bounds that push; not those of holds, which always do, nor any where none is to blame."""
        if self.why is not None and self.why.out_of_reach:
            return ""
        return ", ".join(str(b) for b in self.solution.binding if b.bound != "equal")

    @property
    def reason(self) -> str:
        """Why the target is not reached, in one line."""
        solution = self.solution
        text = f"{solution.status} after {solution.descents} descents; off by {self.off[0]:.3g} m"
        text += f", {self.off[1]:.3g} rad" if self.oriented else ""
        if self.why is not None and self.why.nearest is not None:
            nearest = self.why.nearest.residuals["hand"]
            text += f"; out of reach of the robot itself by {nearest.norm('m'):.3g} m"
            return (
                text + (f" and {nearest.norm('rad'):.3g} rad" if self.oriented else "") + "; no constraint is to blame"
            )
        broken = ", ".join(str(slack) for slack in solution.step.relaxed)
        text += f"; cannot be kept: {broken}" if broken else ""
        if self.why is not None and (self.why.alone or self.why.together):
            items = " or without ".join(self.why.alone) or "all constraints"
            text += f"; within reach without {items}"
        return text + (f"; binding: {self.binding}" if self.binding else "; no row binds")

    def data(self) -> dict[str, object]:
        """For programs, in SI units; ``reason`` where the target is not reached."""
        return {
            "target": self.target,
            "branch": self.branch,
            "solved": self.solved,
            "status": str(self.solution.status),
            "position_error": self.off[0],
            "rotation_error": self.off[1],
            "binding": self.binding,
            "q": self.solution.q.tolist(),
            **({} if self.solved else {"reason": self.reason}),
        }


def save_answers(file: Path, robot: Robot, answers: Sequence[TargetAnswer]) -> None:
    """Write all answers.

    CSV: target, branch, status, position_error [m], rotation_error [rad], binding, then a column for each coordinate.
    npz: the same as arrays, the configurations as ``q`` [count, nq], and ``names`` of the coordinates.

    Raises:
        OSError: the file cannot be written.
    """
    names = list(robot.dof_names) if robot.nq == robot.nv else [f"q{k}" for k in range(robot.nq)]
    columns: dict[str, list[Any]] = {
        "target": [a.target for a in answers],
        "branch": [a.branch for a in answers],
        "status": [str(a.solution.status) for a in answers],
        "position_error": [a.off[0] for a in answers],
        "rotation_error": [a.off[1] for a in answers],
        "binding": [a.binding for a in answers],
    }
    q = np.array([a.solution.q for a in answers])
    if file.suffix.lower() == ".csv":
        with file.open("w", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow([*columns, *names])
            writer.writerows([*row, *x] for *row, x in zip(*columns.values(), q.tolist(), strict=True))
    else:
        with file.open("wb") as binary:
            arrays: dict[str, Any] = {name: np.array(column) for name, column in {**columns, "names": names}.items()}
            np.savez(binary, **arrays, q=q)
