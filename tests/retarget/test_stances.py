"""Stances are found by speed and height, at any rate and scale, with noise, on stairs and in jumps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.retarget import clips
from wbc.retarget import Clip
from wbc.retarget.clip import intervals
from wbc.retarget.stances import Stances, find_stances, with_hysteresis

FEET = {"left_leg": ("LeftFoot", "LeftToe"), "right_leg": ("RightFoot", "RightToe")}
HANDS = {"left_arm": ("LeftHand", "LeftHandEnd"), "right_arm": ("RightHand", "RightHandEnd")}
LEG = clips.THIGH + clips.SHANK


def found(clip: Clip, size: float = 1.0) -> Stances:
    """Stances of a clip whose lengths are multiplied."""
    number = clip.skeleton.names.index
    ends = {limb: size * clip.points[:, [number(name) for name in names]] for limb, names in (FEET | HANDS).items()}
    return find_stances({k: ends[k] for k in FEET}, {k: ends[k] for k in HANDS}, clip.rate, size * LEG)


def true_marks(made: clips.Made) -> dict[str, np.ndarray]:
    """What stands, by limb."""
    names = {"LeftFoot": "left_leg", "RightFoot": "right_leg", "LeftHand": "left_arm", "RightHand": "right_arm"}
    return {names[foot]: marks for foot, marks in made.stance.items()}


@pytest.mark.parametrize("name", ["walk", "run", "turn", "jump", "stairs", "sit", "dance", "crawl"])
@pytest.mark.parametrize("seed", [0, 1])
def test_stances_of_every_clip(name: str, seed: int) -> None:
    made = getattr(clips, name)(seed)
    marks = found(made.clip).marks
    late = int(0.07 * made.clip.rate)
    for limb, true in true_marks(made).items():
        assert len(intervals(marks[limb])) == len(intervals(true)), limb
        for (a, b), (c, d) in zip(intervals(marks[limb]), intervals(true), strict=True):
            assert max(abs(a - c), abs(b - d)) <= late, limb
    for limb in set(HANDS) - set(true_marks(made)):
        assert not marks[limb].any()


@pytest.mark.parametrize("rate", [20.0, 30.0, 120.0, 500.0])
@pytest.mark.parametrize("size", [0.2, 1.0, 100.0])
def test_any_rate_and_any_scale(rate: float, size: float) -> None:
    made = clips.walk(3, rate)
    marks = found(made.clip, size).marks
    for limb, true in true_marks(made).items():
        assert len(intervals(marks[limb])) == len(intervals(true))
        assert np.mean(marks[limb] == true) > 0.93


@pytest.mark.parametrize("seed", range(3))
def test_noise_breaks_no_stance(seed: int) -> None:
    made = clips.walk(seed, 100.0)
    marks = found(clips.noisy(made.clip, seed, 0.002)).marks
    for limb, true in true_marks(made).items():
        assert len(intervals(marks[limb])) == len(intervals(true))


def test_a_foot_that_is_held_in_the_air_does_not_stand() -> None:
    still = np.zeros((100, 2, 3))
    still[:, :, 2] = [0.08, 0.02]
    air = still + [0.0, 0.2, 0.25]
    marks = find_stances({"left_leg": still, "right_leg": air}, {}, 50.0, LEG).marks
    assert marks["left_leg"].all()
    assert not marks["right_leg"].any()


def test_hysteresis() -> None:
    speed = np.array([1.0, 0.4, 0.2, 0.4, 0.4, 1.0, 0.4, 0.4, 1.0])
    assert with_hysteresis(speed, 0.3, 0.5).tolist() == [False, True, True, True, True, False, False, False, False]


def test_the_height_of_a_standing_ankle() -> None:
    assert found(clips.walk(0).clip).ankle["left_leg"] == pytest.approx(clips.ANKLE, abs=0.01)
    assert found(clips.stairs(0).clip).ankle["left_leg"] == pytest.approx(clips.ANKLE, abs=0.02)
