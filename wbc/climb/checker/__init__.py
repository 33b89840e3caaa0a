"""Whether a climb, as logged, is one that robot and scene allow; shares no code with planner and loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.climb.checker.checking import check as check
    from wbc.climb.checker.report import (
        CheckRules as CheckRules,
        ClimbReport as ClimbReport,
        RuleFinding as RuleFinding,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
