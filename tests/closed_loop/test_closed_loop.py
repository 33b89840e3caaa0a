"""Every task and constraint in its loop, on robots in turn, from random starts."""

from __future__ import annotations

import pytest

from tests.closed_loop import cases, collisions
from tests.items import ITEMS


def test_every_class_has_a_case() -> None:
    """Contacts and what else is about forces are in tests/torque."""
    checked = {cls.__name__ for group in cases.GROUPS.values() for cls, _ in group.checks.values()}
    assert checked == {name for name, kind in ITEMS.items() if not kind.force}


@pytest.mark.parametrize(
    ("group", "check", "robot"),
    # Loops of spheres and segments are compiled; as expressions they take twice as long
    [pytest.param(*run, marks=[pytest.mark.compiled] * (run[0] == "collisions")) for run in cases.RUNS],
)
def test_item(group: str, check: str, robot: str) -> None:
    known = cases.GROUPS[group]
    known.checks[check][1](cases.loop(known.build, robot))


def test_rows_for_corners_keep_arms_from_rocking() -> None:
    """With one row a sensed pair two arms side by side roll over each other, deeper than the whole margin."""
    with pytest.raises(AssertionError, match=r"\{'deepest': (np.float64\()?-0.0[1-9]"):
        collisions.folded(collisions.one_row_a_pair(), "self, sensed", 8)
