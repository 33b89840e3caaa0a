"""``wbc analyse`` of a whole tree of arms, by blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rich.markup import escape

from wbc import validation
from wbc.analysis import BlockAnalysis, Budget, ExactModel, Notation, TreeAnalysis, analyse_blocks
from wbc.analysis.algebra.locus import Located
from wbc.cli.analysis.certificates import Subdivision, certified_tree, record_tree
from wbc.cli.console import out
from wbc.coordinates import tree_sets
from wbc.errors import RangeError

#: Minutes that a certificate gets where the search has used them up
_LEAST = 1e-6


def analyse_tree(
    robot: str,
    chosen: Sequence[str],
    algorithm: str,
    latex: bool,
    refused: Mapping[str, object],
    pictures: Callable[[ExactModel, Located, str], None] | None = None,
    how: Subdivision | None = None,
    minutes: float = 30.0,
) -> list[dict[str, Any]]:
    """Sets of a tree by name, all of them by default, printed and as data.

    Args:
        pictures: called with every block's robot, loci and name.
        how: to certify each set as well, block by block. minutes: by the clock, for all the work on one set.
        refused: option -> whether it was given, of those that have no meaning for blocks.

    Raises:
        UnknownNameError: no such set. RangeError: an option that was given and is refused.
    """
    for option, given in refused.items():
        if given:
            reason = "not for a tree, which is decided by blocks: analyse its arms (ssrms, spdm --full) by themselves"
            raise RangeError(option, given, reason)
    known = tree_sets(robot)
    model = ExactModel(known.robot)
    records = []
    for name in [validation.one_of("set", name, known.sets) for name in chosen or known.sets]:
        one = known.sets[name]
        budget = Budget(minutes=minutes)
        share = minutes if how is None else 0.5 * minutes
        budget.start()
        found = analyse_blocks(model, one.task, one.constraints, algorithm=algorithm, minutes=share)
        _show(name, found, latex)
        if pictures is not None:
            for part in found.blocks:
                pictures(part.model, part.loci, f"{robot} {name} {part.block}")
        records.append(_record(name, found))
        if how is not None:
            records[-1]["certificate"] = record_tree(
                certified_tree(model, robot, name, one, how, max(budget.seconds / 60.0, _LEAST))
            )
    return records


def _show(name: str, found: TreeAnalysis, latex: bool) -> None:
    console = out()
    rows, joints = found.shape
    took = f"{found.seconds:.2f} s by the clock, {found.processor:.2f} s of processor time"
    console.print(f"[bold]{escape(name)}[/bold]: {rows} x {joints}, {found.verdict}, {took}")
    for one in found.blocks:
        shape = " x ".join(map(str, one.loci.augmented.shape))
        console.print(f"  block    {escape(str(one.block))}: {shape}, {_said(one)}", soft_wrap=True)
        notation = Notation(one.loci.exact.half, latex)
        console.print(f"  joints   {escape(notation.joints(one.block.joints))}", soft_wrap=True)
        for line in notation.branches(one.loci.locus.branches):
            console.print(f"  locus    {escape(line)}", soft_wrap=True)
        for line in notation.branches(one.loci.locus.open):
            console.print(f"  open     {escape(line)}", soft_wrap=True)
    if found.witness is not None:
        q = ", ".join(f"{x:.6g}" for x in found.witness.q)
        console.print(f"  witness  q = {q}", soft_wrap=True)
        task, every = found.witness.task[-1], found.witness.augmented[-1]
        console.print(f"           smallest singular value: task {task:.3g}, with constraints {every:.1g}")
        console.print(f"           {escape(str(found.lost))} loses rank")


def _said(one: BlockAnalysis) -> str:
    return "loses rank" if one.verdict == "undecided" else one.verdict


def _record(name: str, found: TreeAnalysis) -> dict[str, Any]:
    witness = found.witness
    return {
        "set": name,
        "shape": list(found.shape),
        "verdict": found.verdict,
        "seconds": found.seconds,
        "processor_seconds": found.processor,
        "blocks": [
            {
                "joints": list(one.block.joints),
                "rows": [str(rows) for rows in one.block.rows],
                "shape": list(one.loci.augmented.shape),
                "verdict": _said(one),
                "locus": [Notation(one.loci.exact.half).branch(b) for b in one.loci.locus.branches],
            }
            for one in found.blocks
        ],
        "lost": None if found.lost is None else str(found.lost),
        "witness": None if witness is None else {"q": witness.q.tolist(), "task": witness.task.tolist()},
    }
