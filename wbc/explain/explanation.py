"""What an explanation of a tick says: data, and the same as text in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.explain.reason import Reason, amount
from wbc.robot import DeadPoint

RELATIONS = {"lower": "at least", "upper": "at most", "equal": "exactly"}

#: Conflicts of up to this many members are told member by member
_LONG = 12
#: Items that are named of a larger conflict
_GROUPS = 6
#: Rows that are named of each of those items
_MEMBERS = 3
#: More prices are told task by task
_PRICES = 24


def listed(bounds: tuple[ExplainedBound, ...]) -> str:
    """Bounds as text, joint limits of one kind together."""
    groups: dict[tuple[str, str], list[str]] = {}
    for bound in bounds:
        if bound.kind:
            text = f"{bound.row} {RELATIONS[bound.which]} {amount(bound.value, bound.unit)}"
            groups.setdefault((bound.item, bound.kind), []).append(text)
    plain = [str(bound) for bound in bounds if not bound.kind]
    return ", ".join([*plain, *(f"{item} ({kind}: {', '.join(rows)})" for (item, kind), rows in groups.items())])


def summary(bounds: tuple[ExplainedBound, ...], shares: tuple[float, ...]) -> str:
    """Many bounds as text, by item: those with the largest shares, the rest counted."""
    groups: dict[str, list[int]] = {}
    for k in sorted(range(len(bounds)), key=lambda k: -shares[k]):
        groups.setdefault(bounds[k].item, []).append(k)
    parts = []
    for item, members in list(groups.items())[:_GROUPS]:
        first = [bounds[k] for k in members[:_MEMBERS]]
        named = ", ".join(f"{b.row} {RELATIONS[b.which]} {amount(b.value, b.unit)}" for b in first)
        more = len(members) - len(first)
        count = f"{len(members)} rows: " if more else ""
        parts.append(f"{item} ({count}{named}{f', and {more} more' if more else ''})")
    rest = list(groups)[_GROUPS:]
    if rest:
        parts.append(f"and {sum(len(groups[item]) for item in rest)} rows of {', '.join(rest)}")
    return ", ".join(parts)


def by_item(bounds: tuple[ExplainedBound, ...]) -> str:
    """Many bounds as text, all of them: those of an item together, its rows of one value too."""
    items: dict[str, dict[str, list[str]]] = {}
    for bound in bounds:
        items.setdefault(bound.item, {}).setdefault(bound.said, []).append(bound.row)
    parts = []
    for item, rows in items.items():
        same = "; ".join(f"{', '.join(names)} {said}" for said, names in rows.items())
        parts.append(f"{item} ({same})")
    return ", ".join(parts)


def by_task(prices: tuple[Price, ...]) -> list[str]:
    """Many prices as text: of every task the highest per unit of each kind of bound."""
    tasks: dict[tuple[str, str], dict[str, list[Price]]] = {}
    for price in prices:
        tasks.setdefault((price.task, price.unit), {}).setdefault(price.bound.unit, []).append(price)
    lines = []
    for (task, unit), kinds in tasks.items():
        count = sum(map(len, kinds.values()))
        most = [max(found, key=lambda p: abs(p.amount)) for found in kinds.values()]
        named = ", ".join(f"{p.bound.name} {amount(p.amount, unit)} per {p.bound.unit}" for p in most)
        lines.append(f"Of {count} active bounds these cost {task} most: {named}.")
    return lines


@dataclass(frozen=True)
class ExplainedBound:
    """A lower or upper bound of a row or of a degree of freedom, or the value of an equality.

    Attributes:
        item, row: names; the row of a joint's bound is its degree of freedom.
        which: ``lower``, ``upper`` or ``equal``.
        value: per second [unit]. unit: of the row's rate, such as m/s.
        kind: what a joint limit is at this value: ``velocity``, ``acceleration`` or ``position``; else empty.
        margin: h of a margin row before the tick, in its unit; None for others.
        actuator: it belongs to the class that never gives way.
    """

    item: str
    row: str
    which: str
    value: float
    unit: str
    kind: str = ""
    margin: float | None = None
    actuator: bool = False

    @property
    def name(self) -> str:
        """``item/row``."""
        return f"{self.item}/{self.row}"

    @property
    def said(self) -> str:
        """What it says about its row."""
        kind = self.kind + " limit: " if self.kind else ""
        text = f"{kind}{RELATIONS[self.which]} {amount(self.value, self.unit)}"
        if self.margin is not None:
            text += f", {amount(self.margin, self.unit.removesuffix('^2').removesuffix('/s'))} to spare"
        return text

    def __str__(self) -> str:
        return f"{self.name} ({self.said})"


@dataclass(frozen=True)
class Give:
    """By how much a bound is relaxed, or would have to be [unit]; inf: no amount is enough."""

    bound: ExplainedBound
    amount: float

    def __str__(self) -> str:
        return f"{self.bound.name} by {amount(self.amount, self.bound.unit)}"


@dataclass(frozen=True)
class Contradiction:
    """Bounds that cannot all hold; without any one of them the others can.

    Attributes:
        bounds: the members.
        alone: what each would have to give if it alone gives and everything else in the stack holds; or, where no
            single one of them ends all conflicts, only the other members.
        enough: the first of these.
        cheapest: the least of them among bounds that may give way at all, a length of ``stack.length`` counted as one
            radian; among all where none may.
        shares: part of each member in the proof that they contradict each other, its multiplier as a share of the sum;
            rows count in radians and ``stack.length``. The text of a large set names the largest first.
    """

    bounds: tuple[ExplainedBound, ...]
    alone: tuple[Give, ...]
    enough: bool
    cheapest: Give
    shares: tuple[float, ...]

    def __str__(self) -> str:
        long = len(self.bounds) > _LONG
        members = summary(self.bounds, self.shares) if long else listed(self.bounds)
        if len(self.bounds) == 1:
            text = f"This cannot hold within the bounds: {members}."
        else:
            text = f"These {len(self.bounds)} cannot hold together, any {len(self.bounds) - 1} of them can: {members}."
        may = [g for g in self.alone if g is not self.cheapest and not g.bound.actuator]
        others = [str(g) for g in may]
        if long and len(may) > _MEMBERS:
            share = dict(zip(self.bounds, self.shares, strict=True))
            may.sort(key=lambda g: -share[g.bound])
            others = [*map(str, may[:_MEMBERS]), f"one of {len(may) - _MEMBERS} others"]
        text += f" Cheapest to relax{'' if self.enough else ' (there are other conflicts too)'}: {self.cheapest}"
        return f"{text}, instead {' or '.join(others)}." if others else f"{text}."


@dataclass(frozen=True)
class Share:
    """What a task would regain if one item were off [unit of the loss]."""

    item: str
    amount: float


@dataclass(frozen=True)
class Loss:
    """How much slower than requested a task is served, or a soft constraint violated, its rows of one unit together.

    Attributes:
        task, unit: whose rows, and the unit of their rates.
        requested: Euclidean norm of the desired rates, gain e + de/dt. lost: norm of what is missing. Of a soft
            constraint: 0, and norm of its violations.
        alone: norm of what would be missing with every other item off: out of reach, singular, slowed by its gain.
        to: items that it would regain something without, the greatest first. They need not add up to ``lost``.
    """

    task: str
    unit: str
    requested: float
    lost: float
    alone: float
    to: tuple[Share, ...]

    def __str__(self) -> str:
        text = f"{self.task} misses {amount(self.lost, self.unit)} of {amount(self.requested, self.unit)}"
        if self.requested == 0.0:
            text = f"{self.task} gives up {amount(self.lost, self.unit)}"
        if self.to:
            parts = [f"{amount(share.amount, self.unit)} without {share.item}" for share in self.to]
            text += "; it would regain " + ", ".join(parts)
        return text + "."


@dataclass(frozen=True)
class Price:
    """What one unit of a active bound costs a task: the loss falls by ``amount`` per unit by which it is relaxed.

    ``amount`` is -d lost / d bound [unit of the task's rate per unit of the bound's rate]; negative where the task is
    better off with the limit.
    """

    bound: ExplainedBound
    task: str
    amount: float
    unit: str

    def __str__(self) -> str:
        bound, cost = self.bound, amount(self.amount, self.unit)
        return f"{bound.name} {bound.which} costs {self.task} {cost} per {bound.unit}"


@dataclass(frozen=True)
class Residue:
    """The largest of the certificate's residuals of one kind, in physical units, and where it is."""

    amount: float
    unit: str
    where: str

    def __str__(self) -> str:
        return f"{amount(self.amount, self.unit)} ({self.where})" if self.where else amount(self.amount, self.unit)


@dataclass(frozen=True)
class Explanation:
    """Why a tick's command is what it is; from :meth:`wbc.Step.explain`, ``str()`` is the text.

    Attributes:
        status: of the step. answered_by: what gave the answer, see :attr:`wbc.Step.answered_by`.
        broken: items that are on and whose numbers are NaN, infinite or without an interval.
        conflicts: minimal sets of bounds that contradict each other; empty where all rows can hold.
        least: the least sum of squared slack that lets everything hold, by row (metres as ``stack.length`` radians).
        gave_way: what did give way in this tick, in the order of sacrifice.
        binding: what pushes against the command.
        losses: what each task misses, and to whom. prices: what one unit of each active bound costs each task.
        primal: largest violation of a row that did not give way. dual: largest velocity by which one degree of freedom
            alone would better the objective. complementarity: largest distance of an active row from its bound.
        scales: lambda of each scaled task that is slowed down; the rows that keep its direction are not in ``binding``.
        reasons: why each task does or does not converge, see :class:`Reason`.
        lost: of equality rows, what they lose until the next tick per second of it, see :attr:`wbc.Step.lost`.
        dead_points: linkages near one, see :attr:`wbc.Step.dead_points`.
    """

    status: str
    answered_by: str
    broken: tuple[str, ...]
    conflicts: tuple[Contradiction, ...]
    least: tuple[Give, ...]
    gave_way: tuple[Give, ...]
    binding: tuple[ExplainedBound, ...]
    losses: tuple[Loss, ...]
    prices: tuple[Price, ...]
    primal: Residue
    dual: Residue
    complementarity: Residue
    scales: tuple[tuple[str, float], ...] = ()
    reasons: tuple[Reason, ...] = ()
    lost: tuple[Give, ...] = ()
    dead_points: tuple[DeadPoint, ...] = ()

    def __str__(self) -> str:
        lines = [f"{self.status} (by {self.answered_by})." if self.answered_by else f"{self.status}."]
        lines += [f"{point}." for point in self.dead_points]
        if self.broken:
            lines.append(f"Without usable numbers: {', '.join(self.broken)}.")
        lines += [str(conflict) for conflict in self.conflicts]
        if self.least:
            lines.append("The least that ends all conflicts: " + ", ".join(str(g) for g in self.least) + ".")
        if self.gave_way:
            lines.append("What gave way here: " + ", ".join(str(g) for g in self.gave_way) + ".")
        if self.lost:
            lines.append(
                "Lost within the tick, which is long for how rows bend: " + ", ".join(map(str, self.lost)) + "."
            )
        if self.binding:
            many = len(self.binding) > _LONG
            lines.append(f"Binding: {by_item(self.binding) if many else listed(self.binding)}.")
        lines += [f"{task} keeps its direction at {share:.3g} of its rates." for task, share in self.scales]
        lines += [str(reason) for reason in self.reasons]
        lines += [str(loss) for loss in self.losses]
        lines += by_task(self.prices) if len(self.prices) > _PRICES else [f"{price}." for price in self.prices]
        if np.isfinite(self.dual.amount):
            lines.append(
                f"Residuals: rows {self.primal}, optimality {self.dual}, active rows off their bound "
                f"{self.complementarity}."
            )
        return "\n".join(lines)
