"""Laws of many motions are those of calls of their own, bit for bit; impossible ones end no others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wbc
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.extras import MissingPackageError
from wbc.trajectory import Law, jerk_limited, many, time_optimal

RNG = np.random.default_rng(5)
LIMITS: dict[str, Any] = {"velocity": 2.0, "acceleration": 10.0, "jerk": 100.0}


def with_torques(waypoints: Any) -> Law:
    """A law with checks that know the robot."""
    robot = wbc.robots.load("panda")
    return time_optimal(waypoints, 2.0, 10.0, torque=0.5 * robot.limits.effort, robot=robot)


CASES: dict[str, tuple[Callable[..., Law], list[np.ndarray], dict[str, Any]]] = {
    "jerk": (jerk_limited, [RNG.normal(size=(5, 3)), RNG.normal(size=(5, 3))], LIMITS),
    "least time": (time_optimal, [RNG.normal(size=(2, 3, 2))], {"velocity": 2.0, "acceleration": 10.0}),
    "torques": (with_torques, [0.1 * RNG.normal(size=(2, 3, 7)) + wbc.robots.load("panda").neutral], {}),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("processes", [1, 2])
def test_laws_are_those_of_single_calls(name: str, processes: int) -> None:
    law, motions, common = CASES[name]
    laws = many(law, *motions, processes=processes, **common)
    times = np.linspace(0.0, 1.0, 7)
    together = laws.at(times)
    for k, own in enumerate(zip(*motions, strict=True)):
        alone = law(*own, **common)
        assert laws.durations[k] == laws[k].duration == alone.duration
        for part, wanted in zip(together, alone.at(times), strict=True):
            np.testing.assert_array_equal(part[k], wanted)
        assert laws[k].certificate == alone.certificate


@pytest.mark.parametrize("processes", [1, 2])
def test_a_motion_without_a_law_ends_no_others(processes: int) -> None:
    starts, targets = np.zeros((3, 2)), np.ones((3, 2))
    targets[1, 0] = np.nan
    laws = many(jerk_limited, starts, targets, processes=processes, **LIMITS)
    assert list(laws.errors) == [1]
    assert np.isinf(laws.durations).tolist() == [False, True, False]
    assert laws[2].duration == laws[:1][0].duration
    for ask in (lambda: laws[1], lambda: laws.at(0.1), lambda: list(laws)):
        with pytest.raises(WbcError, match=r"motion 1\.target"):
            ask()


def without_package(_waypoints: Any) -> Law:
    """A law of a package that is not installed."""
    raise MissingPackageError("laws", "ruckig", "a jerk-limited law needs this package")


@pytest.mark.parametrize("processes", [1, 2])
def test_a_missing_package_ends_all(processes: int) -> None:
    with pytest.raises(MissingPackageError, match="ruckig"):
        many(without_package, np.zeros((3, 2)), processes=processes)


def test_bad_input_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"motions\[1\]"):
        many(jerk_limited, np.zeros((3, 2)), np.ones((2, 2)), **LIMITS)
    with pytest.raises(ShapeError, match="motions"):
        many(jerk_limited, **LIMITS)
    with pytest.raises(ShapeError, match=r"motions\[0\]"):
        many(jerk_limited, 3.0, np.ones((2, 2)), **LIMITS)
    with pytest.raises(RangeError, match="processes"):
        many(jerk_limited, np.zeros((3, 2)), np.ones((3, 2)), processes=0, **LIMITS)
    with pytest.raises(ShapeError, match="law"):
        many(jerk_limited(0.0, 1.0, **LIMITS), np.zeros((3, 2)))
    none = many(jerk_limited, np.zeros((0, 2)), np.ones((0, 2)), **LIMITS)
    assert len(none) == 0
    with pytest.raises(ShapeError, match="there are none"):
        none.at(0.0)
