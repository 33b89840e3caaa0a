"""Limits that an error names work when they are taken, and what is a little beyond them does not."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from tests.repeats import repeats
from wbc.errors import InfeasibleError, RangeError, WbcError
from wbc.trajectory import Law, blend_path, jerk_limited, pose_polyline, spline_path, time_optimal

NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?"


def named(error: WbcError, pattern: str) -> list[float]:
    """The numbers that stand for ``#`` in a sentence of an error."""
    found = re.search(re.escape(pattern).replace(r"\#", f"({NUMBER})"), str(error))
    assert found is not None, error
    return [float(x) for x in found.groups()]


@pytest.mark.parametrize("end", ["start", "target"])
def test_velocities_that_go_with_an_acceleration(end: str) -> None:
    rng, seen = np.random.default_rng(1), {"velocity": 0, "acceleration": 0}
    for _ in range(repeats(150)):
        v, a, j = (float(10.0 ** rng.uniform(-1.5, 1.5)) for _ in range(3))
        speed, push = float(rng.uniform(-v, v)), float(rng.uniform(-a, a))
        other = float(rng.uniform(-2.0, 2.0))

        def law(speed: float, push: float, sizes: tuple[float, float, float] = (v, a, j), other: float = other) -> Law:
            states = {f"{end}_velocity": [speed], f"{end}_acceleration": [push]}
            velocity, acceleration, jerk = sizes
            return jerk_limited([0.0], [other], velocity=velocity, acceleration=acceleration, jerk=jerk, **states)

        try:
            law(speed, push)
        except InfeasibleError as error:
            part = error.field.removeprefix(f"{end}_")
            seen[part] += 1
            if part == "velocity":
                for limit, beyond in zip(named(error, "what works: # to #"), (-0.01, 0.01), strict=True):
                    assert law(limit, push).certificate.satisfied
                    if abs(limit + beyond * v) <= v:
                        with pytest.raises(InfeasibleError):
                            law(limit + beyond * v, push)
            else:
                largest, with_it = named(error, "largest that works: #, with a velocity of #")
                assert law(with_it, np.copysign(largest, push)).certificate.satisfied
                with pytest.raises(InfeasibleError):
                    law(with_it, 1.01 * np.copysign(largest, push))
    assert min(seen.values()) > repeats(150) // 40


def test_a_velocity_beyond_its_limit_names_the_limit() -> None:
    limit = 1.23456789
    with pytest.raises(RangeError, match="start_velocity") as caught:
        jerk_limited([0.0], [1.0], start_velocity=[2.0], velocity=limit, acceleration=1.0, jerk=1.0)
    (most,) = named(caught.value, "at most #")
    assert most == pytest.approx(limit, rel=1e-5)
    jerk_limited([0.0], [1.0], start_velocity=[most], velocity=limit, acceleration=1.0, jerk=1.0)


def test_shortest_durations_and_largest_speeds_along_paths() -> None:
    rng, refused = np.random.default_rng(2), 0
    for _ in range(repeats(5)):
        n = int(rng.integers(1, 8))
        path = spline_path(rng.uniform(-1.0, 1.0, (3, n)))
        limits = rng.uniform(0.5, 2.0, n), rng.uniform(2.0, 8.0, n)
        with pytest.raises(InfeasibleError) as caught:
            time_optimal(path, *limits, duration=1e-3)
        (shortest,) = named(caught.value, "is # s")
        assert time_optimal(path, *limits, duration=shortest).certificate.satisfied
        asked = {"start_speed": float(rng.uniform(0.0, 3.0)), "end_speed": float(rng.uniform(0.0, 3.0))}
        # What one error names may show that the other speed is too large as well
        for _ in range(4):
            try:
                assert time_optimal(path, *limits, **asked).certificate.satisfied
                break
            except InfeasibleError as error:
                refused += 1
                (most,) = named(error, " is #")
                with pytest.raises(InfeasibleError):
                    time_optimal(path, *limits, **{**asked, error.field: 1.0001 * most})
                asked[error.field] = most
        else:
            pytest.fail(f"no speeds were found for {asked}")
    assert refused >= repeats(5) // 2


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda d: blend_path([[0.0, 0.0], [1.0, 0.3], [0.2, 1.1], [0.3, 0.1]], d), "path.deviation"),
        (
            lambda d: pose_polyline([([0, 0, z], [0, 0, np.sin(z), np.cos(z)]) for z in (0.0, 1.0, 0.2)], d, 1.0),
            "path.deviation",
        ),
        (
            lambda d: pose_polyline([([0, 0, z], [0, 0, np.sin(z), np.cos(z)]) for z in (0.0, 1.0, 0.2)], 1.0, d),
            "path.turn_deviation",
        ),
    ],
)
def test_smallest_corners(make: Callable[[float], object], field: str) -> None:
    with pytest.raises(RangeError) as caught:
        make(1e-14)
    assert caught.value.field == field
    (least,) = named(caught.value, "at least #")
    make(least)
    with pytest.raises(RangeError):
        make(0.98 * least)
