"""No shapes overlap, whatever is asked of the hands; the pairs that no posture brings apart are named.

``WBC_REPEATS=120`` drives all robots for ten minutes each.
"""

from __future__ import annotations

import logging

import pytest

from tests import repeats
from tests.closed_loop.crowded import ROBOTS, drive
from tests.repeats import MORE

#: Those that are loaded and compiled within seconds
QUICK = [("baxter", "auto"), ("panda, hulls", "auto"), ("two ur5", "sensed")]
CASES = [*QUICK, *((name, "auto") for name in ROBOTS if (name, "auto") not in QUICK)] if MORE >= repeats.ALL else QUICK


@pytest.mark.parametrize(("name", "method"), CASES)
def test_no_shapes_overlap(name: str, method: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="wbc"):
        found = drive(name, repeats.repeats(5), method=method)
    assert found.overlaps == 0, found
    ticks = found.status.total()
    # Two arms begin within the margin
    assert found.status["solved"] >= 0.95 * ticks, found
    assert not found.status["braked"], found
    assert "push at once" not in caplog.text
    assert ("left_wrist_1_link[0] and left_wrist_3_link[0]" in caplog.text) == (name == "two ur5")
