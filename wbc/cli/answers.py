"""Targets of ``wbc ik`` as they are typed, and answers as they are printed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from wbc.cli.console import OutputError, out, table, tell
from wbc.cli.reading import numbers
from wbc.errors import ShapeError, WbcError
from wbc.ik.answers import SUFFIXES, TargetAnswer
from wbc.multibody import algebra
from wbc.robot import Robot
from wbc.track.target_file import Target, as_target, read_targets


def given_targets(texts: Sequence[str], file: Path | None) -> list[Target]:
    """The targets of the options, those of the command line first.

    Raises:
        WbcError: no target at all, or what :func:`parse_target` and :func:`read_targets` raise.
    """
    found = [parse_target(text) for text in texts] + ([] if file is None else read_targets(file))
    if not found:
        raise WbcError("target", None, "give at least one with --target or --targets")
    return found


def parse_target(text: str) -> Target:
    """A target from X,Y,Z or X,Y,Z,QX,QY,QZ,QW.

    Raises:
        ShapeError, NotFiniteError, RotationError: no such numbers.
    """
    given = numbers("target", text)
    if len(given) not in (3, 7):
        raise ShapeError("target", text, "expected X,Y,Z or X,Y,Z,QX,QY,QZ,QW")
    return as_target("target", given)


def check_output(file: Path | None, force: bool) -> None:
    """Whether results can be written.

    Raises:
        OutputError: neither CSV nor npz, there is such a file, or there is no folder for it.
    """
    if file is None:
        return
    if file.suffix.lower() not in SUFFIXES:
        raise OutputError("out", str(file), "how its name ends says what is written", SUFFIXES)
    if file.exists() and not force:
        raise OutputError("out", str(file), "there is a file of this name; choose another, or use --force")
    if not file.parent.is_dir():
        raise OutputError("out", str(file), "there is no such folder")


def report(robot: Robot, frame: str, answers: list[TargetAnswer]) -> None:
    """Print a line for each answer, then the configurations; why a target is not reached goes to standard error."""
    several = len({a.target for a in answers}) < len(answers)
    rows = []
    for a in answers:
        colour, solution = ("green" if a.solved else "red"), a.solution
        far = (f"{a.off[0]:.2g}", f"{a.off[1]:.2g}" if a.oriented else "-")
        figures = (*far, str(solution.descents), f"{1e3 * solution.seconds:.3g}")
        label = f"{a.target}.{a.branch}" if several else str(a.target)
        rows.append((label, f"[{colour}]{solution.status}[/{colour}]", *figures, escape(a.binding) or "-"))
    heads = ("target", "status", "off (m)", "off (rad)", "descents", "ms", "binding")
    out().print(table(heads, rows, f"{robot.name}: configurations for {frame}", ("status", "binding")))
    if len(answers) == 1:
        out().print(_joints(robot, answers[0]))
    for row, a in zip(rows, answers, strict=True):
        # As --start takes it
        numbers = ",".join(f"{x:.9g}" for x in a.solution.q)
        out().print(f"[bold]q {row[0]}[/bold]  {numbers}", soft_wrap=True)
    for a in answers:
        if not a.solved:
            tell(f"target {a.target}: {a.reason}")


def _joints(robot: Robot, answer: TargetAnswer) -> Table:
    rows, limits, tree, q = [], robot.limits, robot.tree, answer.solution.q
    index, turned = robot.position_index, robot.difference(algebra(tree).neutral(tree), q)
    for k in (joint.idx_v + k for joint in tree.joints if joint.nv in (1, joint.nq) for k in range(joint.nv)):
        value = float(q[index[k]] if index[k] >= 0 else turned[k])
        bounds = (limits.position_lower[k], limits.position_upper[k])
        texts = (f"{b:.4g}" if np.isfinite(b) else "-" for b in bounds)
        rows.append((robot.dof_names[k], robot.dof_units[k], f"{value:.6f}", *texts))
    return table(("joint", "unit", "position", "lower", "upper"), rows)
