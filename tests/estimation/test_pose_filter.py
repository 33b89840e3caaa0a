"""The filter against least squares, finite differences and its own statistics; the stream's policy; no jump, no NaN."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, strategies as st

from wbc.errors import NotFiniteError, RangeError, ShapeError, SolverError, UnknownNameError
from wbc.estimation import DropoutPolicy, FrameMotion, PoseFilter, PoseStream, StreamState


def motion(rng: np.random.Generator) -> FrameMotion:
    twist, acceleration = rng.uniform(-0.5, 0.5, (2, 6))
    return FrameMotion(pin.SE3(pin.exp3(rng.uniform(-1.0, 1.0, 3)), rng.uniform(-1.0, 1.0, 3)), twist, acceleration)


@pytest.mark.parametrize("order", [2, 3])
def test_without_process_noise_positions_are_those_of_least_squares(order: int) -> None:
    rng = np.random.default_rng(0)
    times, truth = np.sort(rng.uniform(0.0, 2.0, 12)), rng.uniform(-1.0, 1.0, (order, 3))
    powers = np.stack([times - times[-1], (times - times[-1]) ** 2 / 2][: order - 1], axis=1)
    design = np.column_stack([np.ones(12), powers])
    measured = design @ truth + 0.01 * rng.normal(size=(12, 3))
    kalman = PoseFilter((0.01, 0.01), (1e-9, 1e-9), ["constant_twist", "constant_acceleration"][order - 2], (1e3, 1e3))
    for time, place in zip(times, measured, strict=True):
        kalman.update(time, pin.SE3(np.eye(3), place))
    wanted = np.linalg.lstsq(design, measured, rcond=None)[0]
    found = kalman.at(times[-1])
    assert np.allclose(found.pose.translation, wanted[0], atol=1e-6)
    assert np.allclose(found.twist[:3], wanted[1], atol=1e-5)
    spread = 1e-4 * np.linalg.inv(design.T @ design)
    assert np.allclose(np.diag(kalman.covariance)[:3], spread[0, 0], rtol=1e-3)


def test_errors_grow_as_finite_differences_of_the_motion_have_it() -> None:
    rng, t, step = np.random.default_rng(1), 0.7, 1e-6
    kalman, here = PoseFilter((1.0, 1.0), (1e-12, 1e-12)), motion(rng)
    kalman.update(0.0, here.pose)
    kalman._motion = here
    kalman.covariance = np.eye(18)
    columns = []
    for k in range(18):
        error = step * np.eye(18)[k]
        pose = pin.SE3(pin.exp3(error[3:6]) @ here.pose.rotation, here.pose.translation + error[:3])
        moved = FrameMotion(pose, here.twist + error[6:12], here.acceleration + error[12:]).after(t)
        plain = here.after(t)
        turn = pin.log3(moved.pose.rotation @ plain.pose.rotation.T)
        place = moved.pose.translation - plain.pose.translation
        columns.append(
            np.concatenate([place, turn, moved.twist - plain.twist, moved.acceleration - plain.acceleration]) / step
        )
    transition = np.column_stack(columns)
    assert np.allclose(kalman.predicted(t), transition @ transition.T, atol=1e-5)


@given(st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.sampled_from(["constant_twist", "constant_acceleration"]))
def test_noise_of_two_stretches_is_the_noise_of_both(first: float, second: float, model: str) -> None:
    kalman = PoseFilter((0.01, 0.02), (0.3, 0.4), model)
    kalman.update(0.0, pin.SE3.Identity())
    whole = kalman.predicted(first + second)
    kalman.covariance = kalman.predicted(first)
    assert np.allclose(kalman.predicted(second), whole, rtol=1e-9, atol=1e-12)


def test_surprise_is_chi_square_where_the_noise_is_as_declared() -> None:
    """1000 measurements of a motion whose acceleration is white noise: the mean of chi-square(6) is 6 +- 0.11."""
    rng, dt, s, noise = np.random.default_rng(2), 0.02, np.repeat([0.2, 0.3], 3), np.repeat([0.002, 0.004], 3)
    kalman = PoseFilter((0.002, 0.004), (0.2, 0.3), "constant_twist", (1.0, 1.0))
    true, found = FrameMotion(pin.SE3.Identity(), rng.normal(size=6), np.zeros(6)), []
    root = np.linalg.cholesky(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
    for k in range(1000):
        error = noise * rng.normal(size=6)
        kalman.update(k * dt, pin.SE3(pin.exp3(error[3:]) @ true.pose.rotation, true.pose.translation + error[:3]))
        found.append(kalman.surprise)
        place, speed = root @ (s * rng.normal(size=(2, 6)))
        later = true.after(dt)
        pose = pin.SE3(pin.exp3(place[3:]) @ later.pose.rotation, later.pose.translation + place[:3])
        true = FrameMotion(pose, later.twist + speed, np.zeros(6))
    assert abs(np.mean(found[10:]) - 6.0) < 0.45


def test_a_constant_acceleration_is_found_exactly_and_predicted() -> None:
    here = motion(np.random.default_rng(3))
    kalman = PoseFilter((1e-4, 1e-4), (1e-3, 1e-3))
    turning = FrameMotion(here.pose, here.twist, np.concatenate([here.acceleration[:3], 2.0 * here.twist[3:]]))
    for t in np.arange(0.0, 1.0, 0.01):
        kalman.update(float(t), turning.after(float(t)).pose)
    then = kalman.at(1.2)
    assert np.allclose(then.pose.homogeneous, turning.after(1.2).pose.homogeneous, atol=1e-3)
    assert np.allclose(then.twist, turning.after(1.2).twist, atol=1e-2)


def tracking(policy: DropoutPolicy) -> PoseStream:
    stream = PoseStream(PoseFilter((1e-4, 1e-4), (1e-2, 1e-2), "constant_twist"), policy, delay=0.05)
    for t in np.arange(0.0, 1.0, 0.01):
        turn = pin.exp3(np.array([0.0, 0.0, 0.3 * t]))
        stream.push(float(t) + 0.05, pin.SE3(turn, np.array([0.2 * t, 0.0, 0.0])))
    return stream


TRACKED = tracking(DropoutPolicy())._filter


@given(st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_a_lost_frame_comes_to_rest_without_a_jump_and_its_twist_is_that_of_its_motion(p: float, hold: float) -> None:
    stream, h = PoseStream(TRACKED, DropoutPolicy(p, hold)), 1e-5
    for age in (0.5 * p, p + 0.3 * hold, p + 0.9 * hold, p + 1.5 * hold):
        before, here, after = (stream.at(0.99 + age + x) for x in (-h, 0.0, h))
        speed = (after.pose.translation - before.pose.translation) / (2 * h)
        turning = pin.log3(after.pose.rotation @ before.pose.rotation.T) / (2 * h)
        if before.state is after.state:
            assert np.allclose(here.twist, np.concatenate([speed, turning]), atol=1e-6)
            assert np.allclose(here.acceleration, (after.twist - before.twist) / (2 * h), atol=1e-4)
        state = StreamState.TRACKED if age < p else StreamState.HELD if age < p + hold else StreamState.LOST
        assert here.state is state
    assert not stream.at(10.0).twist.any()


def test_late_and_lost_measurements() -> None:
    stream = tracking(DropoutPolicy(0.1, 0.1))
    before = stream.at(1.0).pose
    stream.push(0.5, motion(np.random.default_rng(5)).pose)
    assert stream.late == 1
    assert np.array_equal(stream.at(1.0).pose.homogeneous, before.homogeneous)
    there = motion(np.random.default_rng(4)).pose
    stream.push(3.0, there)
    assert np.allclose(stream.at(2.95).pose.homogeneous, there.homogeneous)
    assert stream.at(2.95).state is StreamState.TRACKED
    # A clock that was set back: what is measured then counts for nothing until the stream is told
    stream.push(-7.0, there)
    assert stream.at(-7.0).state is StreamState.LOST
    stream.reset()
    stream.push(-7.0, there)
    assert stream.at(-7.0).state is StreamState.TRACKED
    again = tracking(DropoutPolicy(0.1, 0.1))
    assert np.array_equal(again.at(1.0).pose.homogeneous, before.homogeneous)


def test_bad_input() -> None:
    for wrong, error in (((0.0, 1.0), RangeError), ((1.0,), ShapeError), ((np.nan, 1.0), NotFiniteError)):
        with pytest.raises(error, match="noise"):
            PoseFilter(wrong, (1.0, 1.0))
    with pytest.raises(UnknownNameError, match="constant_twist"):
        PoseFilter((1.0, 1.0), (1.0, 1.0), "constant_twists")  # type: ignore[arg-type]
    stream = PoseStream(PoseFilter((1.0, 1.0), (1.0, 1.0)))
    with pytest.raises(SolverError, match="no measurement"):
        stream.at(0.0)
    with pytest.raises(RangeError, match="hold"):
        DropoutPolicy(hold=0.0)
    kalman = PoseFilter((1.0, 1.0), (1.0, 1.0))
    kalman.update(1.0, pin.SE3.Identity())
    with pytest.raises(RangeError, match="already"):
        kalman.update(0.5, pin.SE3.Identity())
