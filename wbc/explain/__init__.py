"""Why a command is what it is, and how it moves with what the tick was given (floor 7).

What works that out is imported when somebody asks.
"""

from __future__ import annotations

from wbc.explain.explanation import Explanation
from wbc.tick.context import Context
from wbc.validation import Array

__all__ = ["Explanation", "derivative", "escape", "explain"]


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


def escape(data: bytes, context: Context, way: Array | None) -> Array | None:
    """See :func:`wbc.explain.reasons.way_out`; ``data`` is a step's copy of its tick."""
    from wbc.explain.past import past_of
    from wbc.explain.reasons import way_out

    return way_out(past_of(data, context), way)
