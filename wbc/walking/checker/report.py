"""What the checker found: one line a check, with the worst value, its time and where."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from wbc import validation
from wbc.errors import UnknownNameError

#: Unit -> (how it is shown, factor)
SHOWN: Mapping[str, tuple[str, float]] = {
    "m": ("mm", 1e3),
    "rad": ("deg", 57.29577951308232),
    "m/s": ("mm/s", 1e3),
    "rad/s": ("deg/s", 57.29577951308232),
    "s": ("s", 1.0),
    "": ("", 1.0),
}


@dataclass(frozen=True)
class Finding:
    """One check.

    Attributes:
        kind: its name.
        count: samples that violate it; 0 if all is well.
        worst: the largest value, or the least where values must not fall below ``limit``; NaN if nothing was to check.
        limit, unit: in SI.
        time: of the worst value [s]; NaN if there is none.
        where: arm, joint, links or hold of the worst value.
        least: values must not fall below the limit.
    """

    kind: str
    count: int
    worst: float
    limit: float
    unit: str
    time: float
    where: str
    least: bool = False

    @property
    def ok(self) -> bool:
        """Nothing violates the check."""
        return self.count == 0


@dataclass(frozen=True)
class Report:
    """All checks of a walk.

    Attributes:
        findings: one a check, in the order of the checks.
        ticks, samples: how many were checked; duration [s].
        open_freedoms: samples at which the holding hands leave freedoms of the body open; there the body is compared in
            what they fix.
        observed: checks that :attr:`Rules.observe` names: what they find is shown and does not count.
    """

    findings: tuple[Finding, ...]
    ticks: int
    samples: int
    duration: float
    open_freedoms: int
    observed: tuple[Finding, ...] = ()

    @property
    def ok(self) -> bool:
        """Every check holds."""
        return all(finding.ok for finding in self.findings)

    @property
    def violations(self) -> tuple[Finding, ...]:
        """The checks that do not hold."""
        return tuple(finding for finding in self.findings if not finding.ok)

    def __getitem__(self, kind: str) -> Finding:
        """The finding of a check, observed ones among them.

        Raises:
            UnknownNameError: no such check.
        """
        found = {finding.kind: finding for finding in (*self.findings, *self.observed)}
        if kind not in found:
            raise UnknownNameError("check", kind, found)
        return found[kind]

    def __rich__(self) -> Table:
        return self.table()

    def __str__(self) -> str:
        console = Console(file=io.StringIO(), width=140, color_system=None)
        console.print(self.table())
        stream = console.file
        assert isinstance(stream, io.StringIO)
        return "\n".join(line.rstrip() for line in stream.getvalue().rstrip().splitlines())

    def table(self) -> Table:
        """The report as a table."""
        state = "the walk holds" if self.ok else f"{len(self.violations)} of {len(self.findings)} checks are violated"
        title = f"{state}: {self.ticks} ticks, {self.samples} samples, {self.duration:.2f} s"
        out = Table(title=title, title_justify="left", title_style="bold green" if self.ok else "bold red")
        out.box, out.pad_edge = box.SIMPLE, False
        out.padding = (0, 1, 0, 0)
        for name, right in (("check", 0), ("worst", 1), ("limit", 1), ("unit", 0), ("at [s]", 1), ("where", 0)):
            # Numbers stay whole where there are few columns
            out.add_column(Text(name), justify="right" if right else "left", no_wrap=right == 1)
        out.add_column("violated", justify="right")
        for finding in self.findings:
            out.add_row(*_cells(finding), style="" if finding.ok else "red")
        if self.observed:
            out.add_section()
            out.add_row(Text("observed, not counted:"))
        for finding in self.observed:
            out.add_row(*_cells(finding), style="" if finding.ok else "yellow")
        return out


class Tally:
    """Collects the values of checks; stores of each the worst and how many violate it.

    Args:
        observe: checks that do not count.
    """

    def __init__(self, observe: Sequence[str] = ()) -> None:
        self._findings: dict[str, Finding] = {}
        self._observed = tuple(observe)

    def declare(self, kind: str, limit: float, unit: str = "", least: bool = False) -> None:
        """A check: values of at most ``limit``, or at least, with ``least``."""
        self._findings[kind] = Finding(kind, 0, nan, limit, unit, nan, "", least)

    def check_observed(self) -> None:
        """Once all checks are declared: whether those that do not count are some.

        Raises:
            UnknownNameError: one is none.
        """
        for kind in self._observed:
            validation.one_of("Rules.observe", kind, list(self._findings))

    def worst(self, kind: str) -> float:
        """The worst value so far; NaN if there is none."""
        return self._findings[kind].worst

    def add(self, kind: str, values: Any, times: Any, where: Callable[..., str]) -> None:
        """Values of any shape, times that broadcast along the first axis; ``where`` names an index of the values.

        A value that is no number violates the check.
        """
        array = np.asarray(values, dtype=float)
        if array.size == 0:
            return
        old = self._findings[kind]
        sign = -1.0 if old.least else 1.0
        excess = np.where(np.isnan(array), inf, sign * (array - old.limit))
        count = int((excess > 0.0).sum())
        place = tuple(int(i) for i in np.unravel_index(int(np.argmax(excess)), array.shape))
        worst, known = float(array[place]), sign * (old.worst - old.limit)
        if np.isnan(known) or excess[place] > known:
            time = float(np.asarray(times, dtype=float)[place[0]])
            self._findings[kind] = Finding(
                kind, old.count + count, worst, old.limit, old.unit, time, where(*place), old.least
            )
        elif count:
            self._findings[kind] = Finding(
                kind, old.count + count, old.worst, old.limit, old.unit, old.time, old.where, old.least
            )

    def findings(self, observed: bool = False) -> tuple[Finding, ...]:
        """The checks that count, or those that are observed, in the order in which they were declared."""
        return tuple(one for kind, one in self._findings.items() if (kind in self._observed) == observed)


def _cells(finding: Finding) -> list[Text]:
    unit, factor = SHOWN[finding.unit]
    measured = isfinite(finding.time)
    # Where nothing is off, no place is the worst
    placed = measured and (finding.worst != 0.0 or not finding.ok)
    sign = ">= " if finding.least else ""
    texts = [
        finding.kind,
        f"{finding.worst * factor:.4g}" if measured else "-",
        f"{sign}{finding.limit * factor:.4g}",
        unit,
        f"{finding.time:.3f}" if placed else "",
        finding.where if placed else "",
        str(finding.count) if finding.count else "",
    ]
    return [Text(text) for text in texts]
