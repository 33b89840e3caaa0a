"""What ``wbc coordinates analyse`` does: sets of coordinates, their loci and verdicts, printed and as data."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from wbc import robots, validation
from wbc.analysis import (
    BodyRows,
    Budget,
    ExactModel,
    JointRows,
    Notation,
    PitchPlaneRows,
    Rows,
    analyse,
    analyse_blocks,
    published_sets,
)
from wbc.analysis.algebra.half_angles import HalfAngles
from wbc.analysis.algebra.locus import Located
from wbc.analysis.formulas import Formulas
from wbc.analysis.loci.pictures import save_pictures
from wbc.analysis.published import ROBOTS
from wbc.analysis.told import (
    analysis_lines,
    analysis_record,
    certificate_lines,
    certificate_record,
    tree_certificate_lines,
    tree_certificate_record,
    tree_lines,
    tree_record,
)
from wbc.cli import console
from wbc.cli.coordinates.asked import AnalysisAsked
from wbc.cli.coordinates.certificates import certified, certified_tree, state_file, winner
from wbc.cli.scene import tip_frame
from wbc.coordinates import TREES, tree_sets
from wbc.errors import RangeError, RobotFileError

#: Part of the time that is for the search; the rest is for formulas
_SEARCH = 0.9
#: Part of the time that a certificate may take where the locus is searched as well
_PROOF = 0.75
#: Minutes that a certificate gets where the search has used them up
_LEAST = 1e-6


def analysed(asked: AnalysisAsked) -> None:
    """All sets that are asked for."""
    robot, own = _meant(asked), _own(asked)
    if asked.screen is not None and (own or asked.set):
        reason = "finds the constraints by itself: without --set, --lock, --point, --plane"
        raise RangeError("screen", asked.screen, reason)
    if robot in TREES and not own and asked.frame is None:
        records = _analyse_tree(asked, robot)
    else:
        records = _analyse_arm(asked, robot, own)
    found = {"robot": robot, "algorithm": asked.algorithm, "sets": records}
    console.data(found)
    if asked.data is not None:
        with validation.writing("data", asked.data, RobotFileError):
            console.write_json(asked.data, found)


def _analyse_arm(asked: AnalysisAsked, robot: str, own: list[Rows]) -> list[dict[str, Any]]:
    """Sets of one arm."""
    task: tuple[Rows, ...]
    if own or asked.frame is not None or robot not in ROBOTS:
        if not own or asked.set:
            raise RangeError("set", asked.set, "give either --set of a published robot, or --lock, --point, --plane")
        machine = robots.load(robot)
        model = ExactModel(machine, approximate=asked.approximate)
        task, sets = (BodyRows(tip_frame(machine, asked.frame)),), {", ".join(map(str, own)): tuple(own)}
    else:
        known = published_sets(robot)
        model, task = ExactModel(known.robot, known.symbols), known.task
        sets = {name: known.sets[validation.one_of("set", name, known.sets)] for name in asked.set or known.sets}
        if asked.screen is not None:
            best = winner(model, robot, task, asked.screen, asked.minutes)
            sets = {} if best is None else {", ".join(best.names): best.rows}
    for note in model.notes:
        console.say(note)
    console.say(f"joints: {Notation(HalfAngles(model.ring), asked.latex).joints(model.robot.dof_names)}")
    return [_one_set(asked, model, robot, name, task, rows) for name, rows in sets.items()]


def _analyse_tree(asked: AnalysisAsked, robot: str) -> list[dict[str, Any]]:
    """Sets of a tree by name, all of them by default, by blocks."""
    for option in ("approximate", "full", "screen"):
        if value := getattr(asked, option):
            reason = "not for a tree, which is decided by blocks: analyse its arms (ssrms, spdm --full) by themselves"
            raise RangeError(option, value, reason)
    known = tree_sets(robot)
    model, minutes = ExactModel(known.robot), asked.minutes
    records = []
    for name in [validation.one_of("set", name, known.sets) for name in asked.set or known.sets]:
        one = known.sets[name]
        budget = Budget(minutes=minutes)
        share = 0.5 * minutes if asked.certify else minutes
        budget.start()
        found = analyse_blocks(model, one.task, one.constraints, algorithm=asked.algorithm, minutes=share)
        _say(tree_lines(name, found, asked.latex))
        for part in found.blocks:
            _pictures(asked.plot, part.model, part.loci, f"{robot} {name} {part.block}")
        records.append(tree_record(name, found))
        if asked.certify:
            left = max(budget.seconds / 60.0, _LEAST)
            proof = certified_tree(model, name, one, state_file(asked.resume, robot, name), left)
            _say(f"  {line}" for line in tree_certificate_lines(proof))
            records[-1]["certificate"] = tree_certificate_record(proof)
    return records


def _one_set(
    asked: AnalysisAsked, model: ExactModel, robot: str, name: str, task: tuple[Rows, ...], rows: tuple[Rows, ...]
) -> dict[str, Any]:
    """Certificate, if wanted, and locus of one set, printed, and as data."""
    budget, proof = Budget(minutes=asked.minutes), None
    search = budget.part(_SEARCH)
    screened = asked.screen is not None
    if screened or asked.certify or asked.full:
        minutes = search.seconds / 60.0 * (1.0 if screened else _PROOF)
        proof = certified(model, name, task, rows, state_file(asked.resume, robot, name), minutes)
    if screened and proof is not None:
        _say([name, *(f"  {line}" for line in certificate_lines(proof))])
        return {"set": name, "certificate": certificate_record(proof)}

    def early(verdict: str) -> None:
        console.say(f"{name}: {verdict}; the locus is being searched, Ctrl-C ends it")

    found = analyse(model, task, rows, algorithm=asked.algorithm, budget=search, certificate=proof, progress=early)
    texts = Formulas(found, asked.latex, budget.seconds)
    _say(analysis_lines(name, found, texts))
    _pictures(asked.plot, model, found, f"{robot} {name}")
    more = {} if proof is None else {"certificate": certificate_record(proof)}
    return {**analysis_record(name, found, texts), **more}


def _meant(asked: AnalysisAsked) -> str:
    """`spdm` is one arm of it, as in the source, but with --tree or constraints of one's own."""
    if asked.tree and asked.robot not in TREES:
        raise RangeError("tree", asked.robot, f"a tree of arms is one of {', '.join(TREES)}")
    if asked.robot != "spdm" or asked.tree or asked.lock or asked.point or asked.plane:
        return asked.robot
    return "spdm_arm" if asked.full else "spdm_arm_simplified"


def _pictures(folder: Path | None, model: ExactModel, found: Located, name: str) -> None:
    for file in () if folder is None else save_pictures(model, found, folder, re.sub(r"\W+", "-", name)):
        console.say(f"  written  {file}")


def _own(asked: AnalysisAsked) -> list[Rows]:
    """Constraints of one's own."""
    own: list[Rows] = [JointRows(name) for name in asked.lock]
    own += [BodyRows(name, rotation=()) for name in asked.point]
    for text in asked.plane:
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != 2:
            raise RangeError("plane", text, "expected SHOULDER,WRIST: two frames")
        own.append(PitchPlaneRows(parts[0], parts[1]))
    return own


def _say(lines: Iterable[str]) -> None:
    for line in lines:
        console.say(line)
