"""Formulas of loci within a time: those of many joints can take longer to write than to find."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence

from wbc.analysis.algebra.notation import Notation
from wbc.analysis.completeness import Analysis
from wbc.analysis.loci.child import Child, Report
from wbc.analysis.loci.determinants import factored_determinant

#: Time for formulas where nothing is left [s]
_LEAST_SECONDS = 0.2


class Formulas:
    """Texts of an analysis by what they are, as far as they were written in time.

    Attributes:
        shown: lines to be printed: ``cost`` and that of the ``task``, ``locus``, ``open``, ``solved`` and ``det``.
        data: ``locus``, ``algorithmic``, ``open`` and ``latex``, a text a branch. whole: whether nothing is missing.
    """

    def __init__(self, found: Analysis, latex: bool, seconds: float) -> None:
        shown, data = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
        self.shown: Mapping[str, Sequence[str]] = shown
        self.data: Mapping[str, Sequence[str]] = data

        def work(report: Report) -> None:
            for into, texts in ((0, _shown(found, latex)), (1, _data(found))):
                for name, text in texts:
                    report((into, name, text))

        with Child(work, max(seconds, _LEAST_SECONDS)) as child:
            self.whole = child.wait() and child.done
        for into, name, text in child.reports:
            (shown, data)[into][name].append(text)


def _shown(found: Analysis, latex: bool) -> Iterator[tuple[str, str]]:
    notation = Notation(found.exact.half, latex)
    for name, part in (("cost", found.augmented), ("task", found.task)):
        yield name, str(part.cost)
    yield from _named("locus", notation.lines(found.locus.branches))
    for relation in dict.fromkeys(r for b in found.locus.branches for r in b.relations):
        if text := notation.solved(relation):
            yield "solved", text
    yield from _named("open", notation.lines(found.locus.open))
    rows, joints = found.augmented.shape
    if rows == joints and not found.locus.open:
        yield "det", factored_determinant(found.exact, found.augmented).text(latex=latex)


def _data(found: Analysis) -> Iterator[tuple[str, str]]:
    notation = Notation(found.exact.half)
    for name, branches in (("locus", found.locus.branches), ("algorithmic", found.algorithmic)):
        yield from _named(name, map(notation.branch, branches))
    yield from _named("open", map(notation.branch, found.locus.open))
    yield from _named("latex", Notation(found.exact.half, latex=True).lines(found.locus.branches))


def _named(name: str, texts: Iterable[str]) -> Iterator[tuple[str, str]]:
    return ((name, text) for text in texts)
