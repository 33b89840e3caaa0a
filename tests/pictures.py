"""Plots of the tests are small and have no ticks, and their labels may lie on each other: the curves are the same.

Ticks and their labels, which matplotlib alone makes, take half of the time of a plot.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from matplotlib.axis import Axis
from matplotlib.layout_engine import ConstrainedLayoutEngine

from wbc import style

#: Labels are moved apart by drawing all of them twice
_execute = ConstrainedLayoutEngine.execute
_ticks = Axis._update_ticks


@pytest.fixture(autouse=True, scope="session")
def quick_pictures() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda self, figure: None)
        patch.setattr(Axis, "_update_ticks", lambda self: [])
        patch.setitem(style.SETTINGS, "savefig.dpi", 50)
        yield


@pytest.fixture
def as_users_get_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plots of a test that asks for this are drawn as always."""
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", _execute)
    monkeypatch.setattr(Axis, "_update_ticks", _ticks)
    monkeypatch.setitem(style.SETTINGS, "savefig.dpi", 140)
