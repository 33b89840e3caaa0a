"""Via points beyond the published fixtures: speeds of turning, poses that repeat, tiny moves, bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.published.via_walker import place
from wbc.trajectory import Law, via_points

BOUNDS: dict[str, Any] = {"speed": 0.5, "acceleration": 2.0, "angular_acceleration": 4.0, "deviation": 0.02}


def law_of(poses: list[np.ndarray], **bounds: Any) -> Law:
    return via_points(poses, **{**BOUNDS, **bounds})


@pytest.mark.parametrize("angle", [0.1, 1.0, 3.0])
def test_turns_keep_an_angular_speed(angle: float) -> None:
    """T = phi / w + w / a where w is reached, 2 sqrt(phi / a) where it is not."""
    law = law_of([place(0.0), place(0.01, turn=angle)], angular_speed=1.0)
    time = angle / 1.0 + 1.0 / 4.0 if angle > 0.25 else 2.0 * np.sqrt(angle / 4.0)
    assert law.duration == pytest.approx(time, rel=1e-9)
    assert law.certificate.satisfied
    assert law.at(law.duration / 2.0).velocity[5] == pytest.approx(min(1.0, np.sqrt(4.0 * angle)), rel=1e-9)
    assert law.at(law.duration).position == pytest.approx(place(0.01, turn=angle), abs=1e-12)


def test_turns_in_step_with_a_long_way_are_slowed_as_a_whole() -> None:
    law = law_of([place(0.0), place(2.0, turn=1.0)], angular_speed=1.0)
    slower = 1.25 / law.duration
    assert law.at(law.duration / 2.0).velocity[5] == pytest.approx(slower, rel=1e-9)
    assert law.at(1e-3).acceleration[5] == pytest.approx(4.0 * slower**2, rel=1e-9)


def test_motion_stops_at_a_pose_that_is_repeated() -> None:
    poses = [place(0.0), place(0.3), place(0.3), place(0.6)]
    law = law_of(poses)
    assert law.duration == pytest.approx(2.0 * law_of(poses[:2]).duration, rel=1e-12)
    state = law.at(law.duration / 2.0)
    assert state.position == pytest.approx(poses[1], abs=1e-12)
    assert state.velocity == pytest.approx(np.zeros(6), abs=1e-9)


def test_the_way_waits_for_a_turn_on_the_spot() -> None:
    law = law_of([place(0.0), place(0.3), place(0.3, turn=1.0), place(0.6, turn=1.0)])
    away = law_of([place(0.0), place(0.3)]).duration
    assert law.duration == pytest.approx(2.0 * away + 1.0, rel=1e-12)
    assert law.at(away + 0.5).position == pytest.approx(place(0.3, turn=0.5), abs=1e-12)


def test_a_corner_without_deviation_is_a_stop() -> None:
    poses = [place(0.0), place(0.3), place(0.3, 0.3)]
    law = law_of(poses, deviation=0.0)
    assert law.duration == pytest.approx(2.0 * law_of(poses[:2]).duration, rel=1e-12)
    assert law.at(law.duration / 2.0).velocity == pytest.approx(np.zeros(6), abs=1e-9)


def test_straight_back_is_turned_before_the_pose() -> None:
    """The blend of a reversal stops half its reach short of the pose, at most the deviation."""
    law = law_of([place(0.0), place(0.5), place(0.0)])
    x = law.at(np.linspace(0.0, law.duration, 20001)).position[:, 0, 3]
    assert x.max() == pytest.approx(0.48, abs=1e-6)
    assert law.certificate.satisfied


@pytest.mark.parametrize("count", [2, 5])
def test_poses_that_are_the_same_give_a_law_that_stands(count: int) -> None:
    law = law_of([place(1.0, 2.0, 3.0, turn=0.4)] * count)
    assert 0.0 < law.duration <= 1e-6
    state = law.at(np.array([0.0, 0.5, 1.0]) * law.duration)
    assert np.abs(state.position - place(1.0, 2.0, 3.0, turn=0.4)).max() < 1e-15
    assert not state.velocity.any()
    assert not state.acceleration.any()
    assert law.certificate.ratio == 0.0


@pytest.mark.parametrize("size", [1e-2, 1e-5, 1e-8, 1e-10])
def test_moves_of_every_size(size: float) -> None:
    unit = [place(0.0), place(1.0), place(1.0, 1.0), place(0.0, 1.5)]
    poses = []
    for k, pose in enumerate(unit):
        small = np.eye(4)
        small[:3, 3] = size * pose[:3, 3]
        small[:3, :3] = pin.exp3(size * k * np.array([0.0, 0.6, 0.8]))
        poses.append(small)
    law = law_of(poses, deviation=0.02 * size)
    assert law.certificate.satisfied
    assert np.abs(law.at(law.duration).position - poses[-1]).max() < 1e-9 * size + 2e-16
    # Times go with the root of the size, where no speed is reached
    large = law_of([place(*(1e-3 * p[:3, 3])) for p in unit], deviation=0.02e-3)
    still = law_of([place(*(size * p[:3, 3])) for p in unit], deviation=0.02 * size)
    if size < 1e-3:
        assert still.duration == pytest.approx(large.duration * np.sqrt(size / 1e-3), rel=1e-4)


def test_laws_of_poses_can_be_joined_reversed_and_scaled() -> None:
    there = law_of([place(0.0), place(0.3), place(0.3, 0.3, turn=1.0)])
    back = there.reversed().scaled(2.0)
    both = there.then(back)
    assert both.duration == pytest.approx(3.0 * there.duration, rel=1e-12)
    assert both.certificate.satisfied
    assert both.at(both.duration).position == pytest.approx(place(0.0), abs=1e-12)
    time = 0.4 * there.duration
    assert both.at(both.duration - 2.0 * time).position == pytest.approx(there.at(time).position, abs=1e-12)
    assert both.at(both.duration - 2.0 * time).velocity == pytest.approx(-0.5 * there.at(time).velocity, abs=1e-12)


def test_every_form_of_a_pose_is_taken() -> None:
    matrix = place(0.2, turn=0.5)
    whole = pin.SE3(matrix)
    numbers = pin.SE3ToXYZQUAT(whole)
    laws = [law_of([place(0.0), form]) for form in (matrix, whole, numbers, numbers.tolist())]
    ends = [law.at(law.duration).position for law in laws]
    assert np.abs(np.array(ends) - matrix).max() < 1e-15
