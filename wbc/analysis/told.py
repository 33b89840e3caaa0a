"""Results of analyses in words, a line each, and as plain data."""

from __future__ import annotations

from typing import Any

from wbc.analysis.algebra.notation import Notation
from wbc.analysis.block_certificates import TreeCertificate
from wbc.analysis.blocks import BlockAnalysis, TreeAnalysis
from wbc.analysis.certificates.certificate import RankCertificate
from wbc.analysis.certificates.weakest import RankWitness
from wbc.analysis.completeness import Analysis
from wbc.analysis.formulas import Formulas


def analysis_lines(name: str, found: Analysis, texts: Formulas) -> list[str]:
    """An analysis of a set of coordinates in words, with its certificate and what formulas are written."""
    rows, joints = found.augmented.shape
    axes = ", ".join(dict.fromkeys(found.augmented.axes))
    cost, task_cost = ("".join(texts.shown[name]) or "not counted in time" for name in ("cost", "task"))
    square = rows == joints and not found.locus.open
    return [
        f"{name}: {rows} x {joints}, {found.verdict}, {_took(found)}",
        f"  cost     {cost}, task {task_cost}; axes {axes}",
        *([f"  det      {''.join(texts.shown['det']) or 'not expanded within the minutes'}"] if square else []),
        *(f"  {kind:8} {line}" for kind in ("locus", "solved", "open") for line in texts.shown[kind]),
        *([] if texts.whole else ["  more     formulas were not written within the minutes"]),
        *(f"  {line}" for line in (certificate_lines(found.certificate) if found.certificate is not None else ())),
        *(_witness(found.witness) if found.witness is not None and found.witness.branch is not None else ()),
    ]


def tree_lines(name: str, found: TreeAnalysis, latex: bool = False) -> list[str]:
    """An analysis by blocks in words."""
    rows, joints = found.shape
    lines = [f"{name}: {rows} x {joints}, {found.verdict}, {_took(found)}"]
    for one in found.blocks:
        notation = Notation(one.loci.exact.half, latex)
        lines.append(f"  block    {one.block}: {' x '.join(map(str, one.loci.augmented.shape))}, {_said(one)}")
        lines.append(f"  joints   {notation.joints(one.block.joints)}")
        lines += [f"  locus    {line}" for line in notation.branches(one.loci.locus.branches)]
        lines += [f"  open     {line}" for line in notation.branches(one.loci.locus.open)]
    if found.witness is not None:
        lines += [*_witness(found.witness), f"           {found.lost} loses rank"]
    return lines


def tree_certificate_lines(found: TreeCertificate) -> list[str]:
    """A certificate by blocks in words."""
    where = {True: " everywhere", False: " outside the tubes of the blocks"}[found.everywhere]
    said = {"complete": where, "undecided": f": {found.left:.3g} of the volume is left", "incomplete": ""}
    lines = [f"certificate  {found.verdict}{said[found.verdict]}, by blocks; {found.seconds:.1f} s by the clock"]
    for block, own in found.blocks:
        lines += [f"block    {block}", *(f"  {line}" for line in certificate_lines(own))]
    if found.witness is not None:
        lines += _numeric_witness(found.witness)
        lines.append(f"{found.lost} loses rank; the tube is sigma_min(J_T) < {found.eps:.4g}")
    return lines


def certificate_lines(found: RankCertificate) -> list[str]:
    """A certificate in words."""
    tube = f"sigma_min(J_T) < {found.eps:.4g} ({found.eps / found.peak:.3g} of its maximum)" if found.peak else ""
    if found.verdict == "incomplete" and found.witness is not None:
        first, second = _numeric_witness(found.witness)
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


def analysis_record(name: str, found: Analysis, texts: Formulas) -> dict[str, Any]:
    """An analysis as data; formulas as text and as LaTeX, as far as they are written."""
    notation = Notation(found.exact.half)
    return {
        "set": name,
        "shape": list(found.augmented.shape),
        "verdict": found.verdict,
        "seconds": found.seconds,
        "processor_seconds": found.processor,
        "joints": {notation.label(k): joint for k, joint in enumerate(found.joints)},
        "cost": "".join(texts.shown["cost"]),
        **{kind: texts.data[kind] for kind in ("locus", "latex", "algorithmic", "open")},
        "formulas": "all" if texts.whole else "those that were written within the minutes",
        "witness": _witness_record(found.witness),
    }


def tree_record(name: str, found: TreeAnalysis) -> dict[str, Any]:
    """An analysis by blocks as data."""
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
        "witness": _witness_record(found.witness),
    }


def certificate_record(found: RankCertificate) -> dict[str, Any]:
    """A certificate as data."""
    return {
        **_taken(found, "verdict", "eps", "peak", "everywhere", "left"),
        "boxes": found.counts.boxes,
        "joints": [f"q{k + 1}" for k in found.joints],
        "symmetries": found.symmetries,
        "seconds": found.seconds,
        "witness": _witness_record(found.witness),
    }


def tree_certificate_record(found: TreeCertificate) -> dict[str, Any]:
    """A certificate of a tree as data."""
    return {
        **_taken(found, "verdict", "everywhere", "left", "eps", "seconds"),
        "blocks": [{"block": str(block), **certificate_record(own)} for block, own in found.blocks],
        "lost": None if found.lost is None else str(found.lost),
        "witness": _witness_record(found.witness),
    }


def _taken(found: object, *names: str) -> dict[str, Any]:
    return {name: getattr(found, name) for name in names}


def _took(found: Analysis | TreeAnalysis) -> str:
    return f"{found.seconds:.2f} s by the clock, {found.processor:.2f} s of processor time"


def _witness(found: RankWitness) -> list[str]:
    task, every = found.task[-1], found.augmented[-1]
    return [
        f"  witness  q = {', '.join(f'{x:.6g}' for x in found.q)}",
        f"           smallest singular value: task {task:.3g}, with constraints {every:.1g}",
    ]


def _numeric_witness(found: RankWitness) -> list[str]:
    q = ", ".join(f"{x:.9g}" for x in found.q)
    task = f"task {found.task[-1]:.4g}, " if len(found.task) else ""
    return [
        f"witness q = {q}",
        f"             smallest singular value: {task}with constraints {found.augmented[-1]:.1g}",
    ]


def _witness_record(found: RankWitness | None) -> dict[str, Any] | None:
    """A witness as data, if there is one."""
    return None if found is None else {"q": found.q.tolist(), "task": found.task.tolist()}


def _said(one: BlockAnalysis) -> str:
    return "loses rank" if one.verdict == "undecided" else one.verdict
