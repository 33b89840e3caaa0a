"""``wbc analyse``: rank analysis of published coordinate sets, or of locks and points of any robot."""

from __future__ import annotations

import functools
import json
import re
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from wbc import robots, validation
from wbc.analysis import (
    ALGORITHMS,
    Analysis,
    BodyRows,
    Budget,
    ExactModel,
    JointRows,
    Notation,
    PitchPlaneRows,
    Rows,
    analyse,
    factored_determinant,
    published_sets,
)
from wbc.analysis.algebra.half_angles import HalfAngles
from wbc.analysis.algebra.locus import Located
from wbc.analysis.loci.child import Child
from wbc.analysis.loci.pictures import save_pictures
from wbc.analysis.published import ROBOTS
from wbc.cli import results
from wbc.cli.analysis.certificates import Subdivision, certified, record, show_certificate, winner
from wbc.cli.analysis.trees import analyse_tree
from wbc.cli.console import out, print_json
from wbc.cli.options import RobotName
from wbc.cli.planning import tip_frame
from wbc.coordinates import TREES
from wbc.errors import RangeError, RobotFileError

#: Part of the time that a certificate may take where the locus is searched as well
_PROOF = 0.75
_WHAT, _OUTPUT = "What is analysed", "What it writes"

Sets = Annotated[
    list[str] | None,
    typer.Option("--set", help="A published set, such as 'elbow, beta, gamma'; default: all.", rich_help_panel=_WHAT),
]
Locks = Annotated[list[str] | None, typer.Option("--lock", help="Joint held as a constraint.", rich_help_panel=_WHAT)]
Points = Annotated[
    list[str] | None, typer.Option("--point", help="Frame whose position is a constraint.", rich_help_panel=_WHAT)
]
Planes = Annotated[
    list[str] | None,
    typer.Option("--plane", help="SHOULDER,WRIST: frames of a pitch plane whose rate is one.", rich_help_panel=_WHAT),
]
Frame = Annotated[
    str | None, typer.Option(help="Frame whose pose is the task. Default: the tip.", rich_help_panel=_WHAT)
]
Algorithm = Annotated[str, typer.Option(help=f"One of {', '.join(ALGORITHMS)}.", rich_help_panel=_WHAT)]
Approximate = Annotated[
    bool, typer.Option("--approximate", help="Rational rotations for inexact ones.", rich_help_panel=_WHAT)
]
Full = Annotated[
    bool,
    typer.Option("--full", help="Of spdm the arm with all offsets, with --certify.", rich_help_panel=_WHAT),
]
Tree = Annotated[
    bool,
    typer.Option("--tree", help="Of spdm all 15 joints, decided by blocks, instead of one arm.", rich_help_panel=_WHAT),
]
Certify = Annotated[
    bool, typer.Option("--certify", help="Prove it by subdivision of joint space as well.", rich_help_panel=_WHAT)
]
Screen = Annotated[
    int | None,
    typer.Option(help="Certify the best set of at most so many constraints instead.", rich_help_panel=_WHAT),
]
Minutes = Annotated[
    float,
    typer.Option(help="By the clock, for all the work on one set, or for a screen, at most.", rich_help_panel=_WHAT),
]
Resume = Annotated[
    Path | None,
    typer.Option(help="Folder to keep certificates in and go on from.", rich_help_panel=_OUTPUT),
]
Plot = Annotated[Path | None, typer.Option("--plot", help="Folder for pictures of the loci.", rich_help_panel=_OUTPUT)]
Latex = Annotated[bool, typer.Option("--latex", help="Formulas as LaTeX.", rich_help_panel=_OUTPUT)]
Data = Annotated[Path | None, typer.Option("--data", help="JSON file for the results.", rich_help_panel=_OUTPUT)]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the results as JSON, and nothing else.", rich_help_panel=_OUTPUT)
]


def analyse_(
    robot: RobotName,
    chosen: Sets = None,
    lock: Locks = None,
    point: Points = None,
    plane: Planes = None,
    frame: Frame = None,
    algorithm: Algorithm = "sub_determinants",
    approximate: Approximate = False,
    full: Full = False,
    tree: Tree = False,
    certify: Certify = False,
    screen: Screen = None,
    minutes: Minutes = 5.0,
    resume: Resume = None,
    plot: Plot = None,
    latex: Latex = False,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Say where task and constraint coordinates lose rank, and whether they always suffice.

    The published arms have sets by name; spdm_on_ssrms, and spdm with --tree, have sets of all their joints, decided by
    blocks. --lock, --point and --plane make a set for any robot.
    """
    validation.one_of("algorithm", algorithm, ALGORITHMS)
    if as_json:
        results.collect()
    robot = _meant(robot, tree, full, bool(lock or point or plane))
    how = Subdivision(resume) if certify or full or screen is not None else None
    own = _own(lock, point, plane)
    if screen is not None and (own or chosen):
        raise RangeError("screen", screen, "finds the constraints by itself: without --set, --lock, --point, --plane")
    if robot in TREES and not own and frame is None:
        refused = {"approximate": approximate, "full": full, "screen": screen}
        pictures = None if plot is None else functools.partial(_pictures, plot)
        found_sets = analyse_tree(robot, chosen or (), algorithm, latex, refused, pictures, how, minutes)
        _write(data, as_json, {"robot": robot, "algorithm": algorithm, "sets": found_sets})
        return
    task: tuple[Rows, ...]
    if own or frame is not None or robot not in ROBOTS:
        if not own or chosen:
            raise RangeError("set", chosen, "give either --set of a published robot, or --lock, --point, --plane")
        machine = robots.load(robot)
        model = ExactModel(machine, approximate=approximate)
        task, sets = (BodyRows(tip_frame(machine, frame)),), {", ".join(map(str, own)): tuple(own)}
    else:
        known = published_sets(robot)
        model, task = ExactModel(known.robot, known.symbols), known.task
        wanted = [validation.one_of("set", name, known.sets) for name in chosen or known.sets]
        sets = {name: known.sets[name] for name in wanted}
        if screen is not None:
            best = winner(model, robot, task, screen, minutes)
            sets = {} if best is None else {", ".join(best.names): best.rows}
    for note in model.notes:
        out().print(escape(note))
    joints = Notation(HalfAngles(model.ring), latex).joints(model.robot.dof_names)
    out().print(f"joints: {escape(joints)}", soft_wrap=True)
    records = []
    for name, rows in sets.items():
        budget = Budget(minutes=minutes)
        if screen is not None and how is not None:
            out().print(f"[bold]{escape(name)}[/bold]")
            proof = certified(model, robot, name, task, rows, how, budget.seconds / 60.0)
            show_certificate(proof)
            records.append({"set": name, "certificate": record(proof)})
            continue
        entry, found = _one_set(model, robot, name, task, rows, algorithm, budget, how, latex)
        records.append(entry)
        if plot is not None:
            _pictures(plot, model, found, f"{robot} {name}")
    _write(data, as_json, {"robot": robot, "algorithm": algorithm, "sets": records})


def _one_set(
    model: ExactModel,
    robot: str,
    name: str,
    task: tuple[Rows, ...],
    rows: tuple[Rows, ...],
    algorithm: str,
    budget: Budget,
    how: Subdivision | None,
    latex: bool,
) -> tuple[dict[str, Any], Analysis]:
    """Certificate, if wanted, and locus of one set, printed, and as data."""
    proof = None
    if how is not None:
        proof = certified(model, robot, name, task, rows, how, _PROOF * budget.seconds / 60.0)
    early = functools.partial(_known, name)
    found = analyse(model, task, rows, algorithm=algorithm, budget=budget, certificate=proof, progress=early)
    _show(name, found, latex, budget)
    entry = _record(name, found)
    if proof is not None:
        entry["certificate"] = record(proof)
    return entry, found


def _known(name: str, verdict: str) -> None:
    """A verdict that is known before the locus."""
    out().print(f"[bold]{escape(name)}[/bold]: {verdict}; the locus is being searched, Ctrl-C ends it")


def _meant(robot: str, tree: bool, full: bool, own: bool) -> str:
    """`spdm` is one arm of it, as in the source, but with --tree or constraints of one's own."""
    if tree and robot not in TREES:
        raise RangeError("tree", robot, f"a tree of arms is one of {', '.join(TREES)}")
    if robot != "spdm" or own or tree:
        return robot
    return "spdm_arm" if full else "spdm_arm_simplified"


def _pictures(folder: Path, model: ExactModel, found: Located, name: str) -> None:
    for file in save_pictures(model, found, folder, re.sub(r"\W+", "-", name)):
        out().print(f"  written  {escape(str(file))}", soft_wrap=True)


def _own(lock: list[str] | None, point: list[str] | None, plane: list[str] | None) -> list[Rows]:
    """Constraints of one's own."""
    own: list[Rows] = [JointRows(name) for name in lock or ()]
    own += [BodyRows(name, rotation=()) for name in point or ()]
    return own + [_plane(text) for text in plane or ()]


def _plane(text: str) -> PitchPlaneRows:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 2:
        raise RangeError("plane", text, "expected SHOULDER,WRIST: two frames")
    return PitchPlaneRows(parts[0], parts[1])


def _show(name: str, found: Analysis, latex: bool, budget: Budget) -> None:
    console, notation = out(), Notation(found.exact.half, latex)
    rows, joints = found.augmented.shape
    took = f"{found.seconds:.2f} s by the clock, {found.processor:.2f} s of processor time"
    console.print(f"[bold]{escape(name)}[/bold]: {rows} x {joints}, {found.verdict}, {took}")
    axes = ", ".join(dict.fromkeys(found.augmented.axes))
    console.print(f"  cost     {found.augmented.cost}, task {found.task.cost}; axes {escape(axes)}", soft_wrap=True)
    if rows == joints and not found.locus.open:
        text = _determinant(found, latex, budget.seconds)
        console.print(f"  det      {escape(text)}", soft_wrap=True)
    for line in notation.branches(found.locus.branches):
        console.print(f"  locus    {escape(line)}", soft_wrap=True)
    for relation in dict.fromkeys(r for b in found.locus.branches for r in b.relations):
        solved = notation.solved(relation)
        if solved:
            console.print(f"  solved   {escape(solved)}", soft_wrap=True)
    for line in notation.branches(found.locus.open):
        console.print(f"  open     {escape(line)}", soft_wrap=True)
    if found.certificate is not None:
        show_certificate(found.certificate)
    if found.witness is not None and found.witness.branch is not None:
        q = ", ".join(f"{x:.6g}" for x in found.witness.q)
        console.print(f"  witness  q = {q}", soft_wrap=True)
        task, every = found.witness.task[-1], found.witness.augmented[-1]
        console.print(f"           smallest singular value: task {task:.3g}, with constraints {every:.1g}")


def _determinant(found: Analysis, latex: bool, seconds: float) -> str:
    """The determinant in factors, if it takes no longer than this."""
    with Child(
        lambda report: report(factored_determinant(found.exact, found.augmented).text(latex=latex)), seconds
    ) as work:
        work.wait(seconds)
        return str(work.reports[0]) if work.reports else "not expanded within the minutes"


def _record(name: str, found: Analysis) -> dict[str, Any]:
    notation, tex = Notation(found.exact.half), Notation(found.exact.half, latex=True)
    witness = found.witness
    return {
        "set": name,
        "shape": list(found.augmented.shape),
        "verdict": found.verdict,
        "seconds": found.seconds,
        "processor_seconds": found.processor,
        "joints": {notation.label(k): joint for k, joint in enumerate(found.joints)},
        "cost": str(found.augmented.cost),
        "locus": [notation.branch(branch) for branch in found.locus.branches],
        "latex": tex.branches(found.locus.branches),
        "algorithmic": [notation.branch(branch) for branch in found.algorithmic],
        "open": [notation.branch(branch) for branch in found.locus.open],
        "witness": None if witness is None else {"q": witness.q.tolist(), "task": witness.task.tolist()},
    }


def _write(path: Path | None, as_json: bool, data: dict[str, Any]) -> None:
    if as_json:
        # Lines and tables say the same
        results.taken()
        print_json(data)
    if path is None:
        return
    try:
        path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise RobotFileError("data", str(path), f"cannot be written: {error.strerror}") from error
