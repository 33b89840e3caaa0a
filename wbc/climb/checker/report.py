"""What a climb must keep, and what a check of it found."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from wbc import validation
from wbc.validation import Array


@dataclass(frozen=True)
class CheckRules:
    """Limits in SI.

    Attributes:
        position: of a joint beyond its limit [m, rad].
        rate: of a joint's mean rate over ``window`` beyond its limit, relative.
        window: time of these means, of at least a tick [s].
        acceleration: of the change of that rate beyond the joint's limit, relative.
        hold_distance: of a closed contact from its foothold [m].
        hold_angle: of its axis, or its pose where that is fixed [rad].
        slip: of a closed contact since it closed [m]. grip_slip: the same of one that pulls [m].
        clearance: least distance of links from bodies and from each other [m].
        depth: how deep a tip may be in the body that it holds, beyond how deep it is while it holds [m].
        swept: distance to which the swept clearance is found; it is proven to this [m].
        margin: least slack of all contact cones at rest, as a share of the weight.
        every: time between instants at which that is looked for [s].
        cone: by which a logged wrench may be outside its cone, as a share of the weight.
        speed: of the body's origin that was asked for, at most [m/s]. turn_rate: of the body [rad/s]. None: none was.
        jump: of the velocity of the body's origin between ticks [m/s]. jump_turn: of its turn rate [rad/s]. None: any.
    """

    position: float = 1e-6
    rate: float = 1e-3
    window: float = 0.01
    acceleration: float = 0.02
    hold_distance: float = 0.002
    hold_angle: float = 0.02
    slip: float = 0.001
    grip_slip: float = 0.001
    clearance: float = 0.0
    depth: float = 2e-4
    swept: float = 2e-4
    margin: float = 0.0
    every: float = 0.1
    cone: float = 1e-6
    speed: float | None = None
    turn_rate: float | None = None
    jump: float | None = None
    jump_turn: float | None = None

    @classmethod
    def by_torques(cls) -> CheckRules:
        """Of a simulator with soft contacts: limbs close up to 7.5 mm beside their footholds, grips in the body
        too, and feet slip by up to 5 mm, grips by 1 mm; their impact accelerates joints beyond what they are asked
        for, up to twice, and moves those that rest at a limit by up to 0.5 mrad or mm beyond it.
        """
        return cls(position=5e-4, hold_distance=0.008, slip=0.005, depth=0.004, acceleration=1.0)

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) is not None or field.default is not None:
                validation.scalar(f"CheckRules.{field.name}", getattr(self, field.name), low=0.0)


@dataclass(frozen=True)
class RuleFinding:
    """One rule.

    Attributes:
        rule: what is to hold. worst: the worst value that was found. limit: what is allowed. unit: of both.
        least: whether the value must be above the limit, and not below it.
        time: of the worst [s]. where: limb, joint or pair of the worst. count: how many values were looked at.
    """

    rule: str
    worst: float
    limit: float
    unit: str
    least: bool
    time: float
    where: str
    count: int

    @property
    def kept(self) -> bool:
        """Whether the rule holds in all that was looked at; with nothing to look at it does."""
        return self.count == 0 or (self.worst >= self.limit if self.least else self.worst <= self.limit)

    def __str__(self) -> str:
        if not self.count:
            return f"{self.rule}: nothing to look at"
        said = "" if self.kept else " VIOLATED"
        bound = f"{'at least' if self.least else 'at most'} {self.limit:.4g}{said}"
        return f"{self.rule}: {self.worst:.4g} {self.unit}, {bound} ({self.where}, {self.time:.3f} s)"


@dataclass(frozen=True)
class ClimbReport:
    """All rules, in the order in which they were looked at."""

    findings: tuple[RuleFinding, ...]

    @property
    def clean(self) -> bool:
        """Whether all rules hold."""
        return not self.violations

    @property
    def violations(self) -> tuple[RuleFinding, ...]:
        """Rules that do not hold."""
        return tuple(finding for finding in self.findings if not finding.kept)

    def __str__(self) -> str:
        return "\n".join(str(finding) for finding in self.findings)


class RuleTally:
    """Collects values rule by rule, and keeps the worst."""

    def __init__(self) -> None:
        self._rules: dict[str, RuleFinding] = {}

    def declare(self, rule: str, limit: float, unit: str, least: bool = False) -> None:
        """A rule, before its first value."""
        worst = float("inf") if least else -float("inf")
        self._rules[rule] = RuleFinding(rule, worst, limit, unit, least, 0.0, "", 0)

    def add(self, rule: str, values: Array, times: Array, where: str) -> None:
        """Values ``[n]`` at times ``[n]``."""
        if not len(values):
            return
        before = self._rules[rule]
        k = int(values.argmin() if before.least else values.argmax())
        worst, count = float(values[k]), before.count + len(values)
        if worst < before.worst if before.least else worst > before.worst:
            before = replace(before, worst=worst, time=float(times[k]), where=where)
        self._rules[rule] = replace(before, count=count)

    def report(self) -> ClimbReport:
        """All rules."""
        return ClimbReport(tuple(self._rules.values()))
