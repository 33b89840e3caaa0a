"""What ``wbc ik`` found: printed, and written to a CSV or npz file."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from wbc import validation
from wbc.cli.console import OutputError, err, out
from wbc.ik import Solution
from wbc.ik.hindrance import Hindrance
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


def check_output(file: Path | None, force: bool) -> None:
    """Whether results can be written.

    Raises:
        UnknownNameError: neither CSV nor npz. OutputError: there is such a file, or there is no folder for it.
    """
    if file is None:
        return
    validation.one_of("out", file.suffix.lower(), SUFFIXES)
    if file.exists() and not force:
        raise OutputError("out", str(file), "there is a file of this name; choose another, or use --force")
    if not file.parent.is_dir():
        raise OutputError("out", str(file), "there is no such folder")


def report(robot: Robot, frame: str, answers: list[TargetAnswer]) -> None:
    """Print a line for each answer, then the configurations; why a target is not reached goes to standard error."""
    console, several = out(), len({a.target for a in answers}) < len(answers)
    title = f"{robot.name}: configurations for {frame}"
    table = Table(title=title, title_justify="left", title_style="bold", header_style="bold", box=None, pad_edge=False)
    table.add_column("target", justify="right")
    if several:
        table.add_column("branch", justify="right")
    table.add_column("status")
    for head in ("off (m)", "off (rad)", "descents", "ms"):
        table.add_column(head, justify="right")
    table.add_column("binding")
    for a in answers:
        colour, solution = ("green" if a.solved else "red"), a.solution
        far = (f"{a.off[0]:.2g}", f"{a.off[1]:.2g}" if a.oriented else "-")
        figures = (*far, str(solution.descents), f"{1e3 * solution.seconds:.3g}")
        label = (str(a.target), str(a.branch)) if several else (str(a.target),)
        table.add_row(*label, f"[{colour}]{solution.status}[/{colour}]", *figures, escape(a.binding) or "-")
    console.print(table)
    if len(answers) == 1:
        console.print(_joints(robot, answers[0]))
    for a in answers:
        name = f"{a.target}.{a.branch}" if several else f"{a.target}"
        console.print(f"[bold]q {name}[/bold]  " + _line(a.solution), soft_wrap=True)
    for a in answers:
        if not a.solved:
            err().print(f"target {a.target}: {escape(a.reason)}", soft_wrap=True)


def save(file: Path, robot: Robot, answers: list[TargetAnswer]) -> None:
    """Write all answers.

    CSV: target, branch, status, position_error [m], rotation_error [rad], binding, then a column for each coordinate.
    npz: the same as arrays, the configurations as ``q`` [count, nq], and ``names`` of the coordinates.

    Raises:
        OutputError: the file cannot be written.
    """
    names = list(robot.dof_names) if robot.nq == robot.nv else [f"q{k}" for k in range(robot.nq)]
    try:
        if file.suffix.lower() == ".csv":
            with file.open("w", newline="") as stream:
                writer = csv.writer(stream, lineterminator="\n")
                writer.writerow(["target", "branch", "status", "position_error", "rotation_error", "binding", *names])
                for a in answers:
                    off = [repr(x) for x in a.off]
                    numbers = [repr(x) for x in a.solution.q.tolist()]
                    writer.writerow([a.target, a.branch, a.solution.status, *off, a.binding, *numbers])
        else:
            with file.open("wb") as binary:
                np.savez(
                    binary,
                    target=np.array([a.target for a in answers]),
                    branch=np.array([a.branch for a in answers]),
                    status=np.array([str(a.solution.status) for a in answers]),
                    position_error=np.array([a.off[0] for a in answers]),
                    rotation_error=np.array([a.off[1] for a in answers]),
                    binding=np.array([a.binding for a in answers]),
                    q=np.array([a.solution.q for a in answers]),
                    names=np.array(names),
                )
    except OSError as error:
        raise OutputError("out", str(file), f"cannot be written: {error.strerror}") from error


def _line(solution: Solution) -> str:
    """Numbers with commas, as ``--start`` takes them."""
    return ",".join(f"{x:.9g}" for x in solution.q)


def _joints(robot: Robot, answer: TargetAnswer) -> Table:
    rows = Table(header_style="bold", box=None, pad_edge=False)
    rows.add_column("joint", no_wrap=True)
    for head in ("unit", "position", "lower", "upper"):
        rows.add_column(head, justify="right")
    limits = robot.limits
    for k in np.flatnonzero(robot.position_index >= 0):
        value = float(answer.solution.q[robot.position_index[k]])
        bounds = (limits.position_lower[k], limits.position_upper[k])
        texts = (f"{b:.4g}" if np.isfinite(b) else "-" for b in bounds)
        rows.add_row(robot.dof_names[k], robot.dof_units[k], f"{value:.6f}", *texts)
    return rows
