"""The time slider: of a recording, and of a loop's last minutes."""

from __future__ import annotations

import pytest

from wbc.viewer import timeline as module
from wbc.viewer.link import SharedTick
from wbc.viewer.timeline import BETWEEN, Timeline


def made(count: int, step: float = 0.1) -> list[SharedTick]:
    return [SharedTick(k + 1, k * step, b"x") for k in range(count)]


def number(timeline: Timeline) -> int:
    state = timeline.state()
    assert state is not None
    return state.number


def test_a_recording_plays_once_and_pauses_at_its_end() -> None:
    timeline = Timeline(made(11))
    assert (number(timeline), timeline.live) == (1, False)
    timeline.advance(0.35)
    assert number(timeline) == 4
    timeline.play(2.0)
    timeline.advance(0.2)
    assert timeline.at == pytest.approx(0.75)
    timeline.advance(5.0)
    assert number(timeline) == 11
    assert timeline.told()["playing"] is False
    timeline.play(1.0)
    assert number(timeline) == 1
    timeline.back()
    assert not timeline.live


@pytest.mark.parametrize(
    ("time", "expected"), [(-3.0, 1), (0.0, 1), (0.49, 5), (0.5, 6), (0.9999999999, 11), (99.0, 11)]
)
def test_seeking_stays_within(time: float, expected: int) -> None:
    timeline = Timeline(made(11))
    timeline.seek(time)
    assert number(timeline) == expected
    timeline.advance(1.0)
    assert number(timeline) == expected


def test_a_live_loop_is_followed_looked_back_at_and_followed_again() -> None:
    timeline = Timeline()
    assert timeline.state() is None
    for state in made(1001, 0.01):
        timeline.add(state)
    assert len(timeline._states) <= 1 + 10.0 / BETWEEN
    assert timeline.live
    assert timeline.told()["at"] == timeline.end
    timeline.seek(5.0)
    shown = timeline.state()
    assert shown is not None
    assert 5.0 - 2 * BETWEEN < shown.time <= 5.0
    timeline.add(SharedTick(2000, 12.0, b"x"))
    assert timeline.state() == shown
    timeline.back()
    assert number(timeline) == 2000
    timeline.play(0.0)
    assert (timeline.live, timeline.at) == (False, 12.0)


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MEMORY", 100)
    timeline = Timeline()
    for k in range(1000):
        timeline.add(SharedTick(k + 1, float(k), b"x"))
        assert len(timeline._states) <= 101
    assert timeline.end == 999.0
    # A loop that begins anew has no past
    timeline.add(SharedTick(1, 0.0, b"x"))
    assert (timeline.begin, timeline.end) == (0.0, 0.0)
