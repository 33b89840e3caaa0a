"""Why a command is what it is, and how it moves with what the tick was given (floor 7).

What works that out is imported when somebody asks.
"""

from __future__ import annotations

from wbc.controller.step import Context
from wbc.explain.explanation import Explanation
from wbc.validation import Array

__all__ = ["Explanation", "derivative", "explain"]


def explain(data: bytes, context: Context, status: str, answered_by: str) -> Explanation:
    """See :meth:`wbc.Step.explain`; ``data`` is a step's copy of its tick."""
    from wbc.explain.explaining import Explainer
    from wbc.explain.past import past_of

    return Explainer(past_of(data, context)).explain(status, answered_by)


def derivative(data: bytes, context: Context, name: str, value: str | None) -> Array:
    """See :meth:`wbc.Step.derivative`; ``data`` is a step's copy of its tick."""
    from wbc.explain import sensitivity
    from wbc.explain.past import past_of

    return sensitivity.derivative(past_of(data, context), name, value)
