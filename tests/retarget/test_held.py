"""In how many frames contacts and motors hold the robot at rest."""

from __future__ import annotations

import pytest

from tests.retarget import clips, motions
from wbc import robots
from wbc.errors import RangeError
from wbc.retarget import Retargeter, held


def test_who_sits_down_slowly_is_held_and_weak_motors_are_named() -> None:
    clip = motions.part(clips.sit().clip, 0.0, 0.5)
    found = held(Retargeter("talos").run(clip), frames=5)
    assert found.share == 1.0
    assert found.contacts == (2,) * 5
    assert "100 %" in str(found)
    robot = robots.load("talos")
    weak = robot.with_limits(effort=2.0)
    lacking = held(Retargeter(weak).run(clip), frames=3)
    assert lacking.share == 0.0
    assert "motors/" in lacking.lacking[0]


def test_a_jump_is_in_the_air_for_a_while() -> None:
    found = held(Retargeter("g1").run(clips.jump().clip), frames=20)
    assert 0 in found.contacts
    assert 2 in found.contacts
    assert "in the air" in str(found)


def test_bad_requests_are_refused() -> None:
    motion = Retargeter("alex_nub_hands").run(motions.part(clips.dance().clip, 0.0, 0.1))
    with pytest.raises(RangeError, match="fixed base"):
        held(motion)
    with pytest.raises(RangeError, match="frames"):
        held(motion, frames=0)
