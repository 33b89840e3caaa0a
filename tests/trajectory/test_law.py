"""The algebra of laws: scaled, reversed, sliced and joined ones against what these words mean."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.trajectory.random_laws import inner_times, ragged, smooth
from wbc.errors import ContinuityError, ShapeError
from wbc.trajectory import Law, PolynomialPath, State, Timing

seeds = st.integers(0, 2**32 - 1)
factors = st.floats(0.05, 20.0)


def assert_states(state: State, position: Any, velocity: Any, acceleration: Any, rel: float = 1e-7) -> None:
    for name, ours, expected in (
        ("position", state.position, position),
        ("velocity", state.velocity, velocity),
        ("acceleration", state.acceleration, acceleration),
    ):
        room = rel * (1.0 + np.abs(expected).max())
        assert np.abs(ours - expected).max() <= room, name


@given(seeds)
@settings(max_examples=15)
def test_velocity_and_acceleration_are_derivatives(seed: int) -> None:
    law = smooth(seed)
    times = inner_times(law, 50)
    h = 1e-7 * law.duration
    before, state, after = law.at(times - h), law.at(times), law.at(times + h)
    assert np.abs((after.position - before.position) / (2.0 * h) - state.velocity).max() < 1e-5 * (
        1.0 + np.abs(state.velocity).max()
    )
    rate = (after.velocity - before.velocity) / (2.0 * h)
    assert np.abs(rate - state.acceleration).max() < 1e-5 * (1.0 + np.abs(state.acceleration).max())
    rate = (after.acceleration - before.acceleration) / (2.0 * h)
    assert np.abs(rate - law.jerk(times)).max() < 1e-5 * (1.0 + np.abs(law.jerk(times)).max())


@given(seeds, factors)
@settings(max_examples=15)
def test_scaling(seed: int, factor: float) -> None:
    law = smooth(seed)
    slow = law.scaled(factor)
    assert slow.duration == pytest.approx(factor * law.duration, rel=1e-14)
    times = inner_times(law)
    state = law.at(times)
    assert_states(slow.at(factor * times), state.position, state.velocity / factor, state.acceleration / factor**2)
    jerk = law.jerk(times) / factor**3
    assert np.abs(slow.jerk(factor * times) - jerk).max() < 1e-7 * (1.0 + np.abs(jerk).max())


@given(seeds, st.integers(1, 5), st.integers(1, 3), factors)
@settings(max_examples=15)
def test_certificates_scale(seed: int, path_degree: int, timing_degree: int, factor: float) -> None:
    """v / k, a / k^2, j / k^3; positions stay."""
    law = ragged(seed, path_degree, timing_degree)
    worst, scaled = law.certificate.worst, law.scaled(factor).certificate.worst
    assert set(worst) == set(scaled)
    for order, name in enumerate(("position", "velocity", "acceleration", "jerk")):
        assert scaled[name].kind == worst[name].kind
        assert scaled[name].ratio == pytest.approx(worst[name].ratio / factor**order, rel=1e-9, abs=1e-12)


@given(seeds)
@settings(max_examples=15)
def test_reversal(seed: int) -> None:
    law = smooth(seed)
    back = law.reversed()
    assert back.duration == law.duration
    times = inner_times(law)
    state = law.at(times)
    assert_states(back.at(law.duration - times), state.position, -state.velocity, state.acceleration)
    twice = back.reversed().at(times)
    assert_states(twice, state.position, state.velocity, state.acceleration)
    for name, worst in law.certificate.worst.items():
        assert back.certificate.worst[name].ratio == pytest.approx(worst.ratio, rel=1e-9)


@given(seeds, st.floats(0.0, 0.9), st.floats(0.05, 1.0))
@settings(max_examples=15)
def test_slicing(seed: int, first: float, share: float) -> None:
    law = smooth(seed)
    start = first * law.duration
    end = start + share * (law.duration - start)
    part = law.sliced(start, end)
    assert part.duration == pytest.approx(end - start, rel=1e-12)
    times = inner_times(law)
    times = times[(times > start) & (times < end)]
    state = law.at(times)
    if len(times):
        assert_states(part.at(times - start), state.position, state.velocity, state.acceleration)
    for time, whole in ((0.0, start), (part.duration, end)):
        assert part.at(time).position == pytest.approx(law.at(whole).position, abs=1e-9)
        assert part.at(time).velocity == pytest.approx(law.at(whole).velocity, abs=1e-8)
    for name in ("position", "velocity", "acceleration"):
        assert part.certificate.worst[name].ratio <= law.certificate.worst[name].ratio * (1.0 + 1e-9)


@given(seeds, st.floats(0.05, 0.95))
@settings(max_examples=15)
def test_parts_joined_are_the_whole(seed: int, share: float) -> None:
    """Also a start in motion: velocities match where they meet."""
    law = smooth(seed)
    middle = share * law.duration
    both = law.sliced(0.0, middle).then(law.sliced(middle, law.duration))
    assert both.duration == pytest.approx(law.duration, rel=1e-14)
    times = np.append(inner_times(law), middle)
    ours, whole = both.at(times), law.at(times)
    assert_states(ours, whole.position, whole.velocity, ours.acceleration)
    assert_states(
        both.at(times[:-1]), *(getattr(law.at(times[:-1]), n) for n in ("position", "velocity", "acceleration"))
    )
    for name, worst in law.certificate.worst.items():
        assert both.certificate.worst[name].ratio == pytest.approx(worst.ratio, rel=1e-8)


@given(seeds)
@settings(max_examples=10)
def test_a_law_stands_before_and_after(seed: int) -> None:
    law = smooth(seed)
    state = law.at([-1e-9, -5.0, law.duration + 1e-9, law.duration + 1e6])
    ends = law.at([0.0, law.duration])
    assert np.array_equal(state.position, ends.position[[0, 0, 1, 1]])
    assert not state.velocity.any()
    assert not state.acceleration.any()
    assert ends.velocity.any()


@pytest.mark.parametrize("shape", [(), (1,), (7,), (0,), (2, 3), (2, 0, 3), (1, 1, 4)])
def test_times_of_every_shape(shape: tuple[int, ...]) -> None:
    law = smooth(3)
    times = np.linspace(-0.1, law.duration + 0.1, int(np.prod(shape))).reshape(shape)
    state = law.at(times)
    assert state.position.shape == state.velocity.shape == state.acceleration.shape == (*shape, 3)
    assert law.jerk(times).shape == (*shape, 3)
    for index in np.ndindex(*shape):
        assert np.array_equal(state.position[index], law.at(times[index]).position)
        assert np.array_equal(state.velocity[index], law.at(float(times[index])).velocity)
    assert np.array_equal(law.at(times.tolist()).position.ravel(), state.position.ravel())


def test_at_breaks_the_later_side_counts_and_at_the_end_the_earlier() -> None:
    path = PolynomialPath([0.0, 1.0, 2.0], [[[1.0], [3.0]], [[0.0], [1.0]]])
    law = Law(path, Timing.identity(2.0))
    assert law.at([0.0, 0.5, 1.0, 1.5, 2.0]).velocity[:, 0].tolist() == [1.0, 1.0, 3.0, 3.0, 3.0]
    back = law.reversed()
    assert back.at([0.0, 0.5, 1.0, 1.5, 2.0]).velocity[:, 0].tolist() == [-3.0, -3.0, -1.0, -1.0, -1.0]
    short = Law(path, Timing.identity(1.0))
    assert short.at(1.0).velocity[0] == 1.0


def test_a_turn_at_a_knot_stays_on_its_piece() -> None:
    """s comes to rest on a knot and goes back: the slope of 3 beyond it is never met."""
    path = PolynomialPath([0.0, 1.0, 2.0], [[[1.0], [3.0]], [[0.0], [1.0]]])
    law = Law(path, Timing([0.0, 1.0, 2.0], [[-1.0, -1.0], [2.0, 0.0], [0.0, 1.0]]))
    assert law.at([0.5, 1.0, 1.5]).acceleration[:, 0].tolist() == [-2.0, -2.0, -2.0]
    assert law.sliced(0.0, 1.0).at(1.0).acceleration[0] == -2.0


def test_laws_that_do_not_meet() -> None:
    law = Law(PolynomialPath([0.0, 1.0], [[[1.0]], [[0.0]]]), Timing.identity(1.0))
    with pytest.raises(ContinuityError, match="position"):
        law.then(law)
    with pytest.raises(ContinuityError, match="velocity"):
        law.then(law.reversed())
    with pytest.raises(ShapeError, match="path"):
        law.then(smooth(0))
    assert law.then(_shifted(law)).duration == 2.0


def _shifted(law: Law) -> Law:
    return Law(PolynomialPath([0.0, 1.0], [[[1.0]], [[1.0]]]), law.timing)
