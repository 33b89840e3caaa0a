"""Runs that arrive and keep all rules of the checker."""

from __future__ import annotations

from wbc.climb import Climber, ClimbScene
from wbc.climb.checker import CheckRules, check
from wbc.climb.loop import ClimbOutcome, ClimbRun


def arrives(run: ClimbRun, climber: Climber, scene: ClimbScene, rules: CheckRules | None = None) -> None:
    """It does both, on a scene, or the first of them that it does not is said."""
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    report = check(run.log, climber, scene, rules)
    assert report.clean, str(report)
