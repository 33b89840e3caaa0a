"""Certificates against dense samples: never below them, and exact where they say so."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from tests.trajectory.random_laws import ragged, smooth
from wbc import trajectory
from wbc.trajectory import Law, LawCertificate, MotionLimits, Path, PolynomialPath, Timing
from wbc.trajectory.laws.certificate import ORDERS, LawPieces

seeds = st.integers(0, 2**32 - 1)


def ratios(law: Law, count: int = 8001) -> dict[str, float]:
    """The largest ratios among so many samples, both sides of every break among them."""
    pieces = LawPieces.of(law.path, law.timing)
    places = np.linspace(0.0, 1.0, count // len(pieces.start) + 1)
    out = {}
    for name, order in ORDERS.items():
        values = pieces.at(law.path, law.timing, order, places)
        if name != "position":
            out[name] = float((np.abs(values) / getattr(law.limits, name)).max())
        elif law.space == "joints":
            middle = 0.5 * (law.limits.upper + law.limits.lower)
            out[name] = float((np.abs(values - middle) / (law.limits.upper - middle)).max())
    return out


@given(seeds, st.integers(1, 9))
@settings(max_examples=20)
def test_polynomials_of_time_are_exact(seed: int, degree: int) -> None:
    """Within 1e-9 of the largest value, which is at an end or where the derivative has a root."""
    random = np.random.default_rng(seed)
    path = PolynomialPath([0.0, 1.0], random.normal(size=(degree + 1, 1, 2)))
    limits = MotionLimits(-np.ones(2), np.ones(2), np.ones(2), np.ones(2), np.ones(2))
    law = Law(path, Timing.identity(1.0), limits, moving=(True, True))
    for name, order in ORDERS.items():
        worst = law.certificate.worst[name]
        assert worst.kind == "exact"
        assert (worst.between, worst.spacing) == (0.0, 0.0)
        true = max(_highest(np.poly1d(path.coefficients[:, 0, k]).deriv(order)) for k in range(2))
        assert true * (1.0 - 1e-12) <= worst.ratio <= true + 1e-9 * (1.0 + true)
        value = np.poly1d(path.coefficients[:, 0, worst.joint]).deriv(order)(worst.time)
        assert abs(value) == pytest.approx(true, rel=1e-6, abs=1e-9)


def _highest(p: np.poly1d) -> float:
    roots = p.deriv().roots if p.order > 1 else np.zeros(0)
    places = np.concatenate([[0.0, 1.0], np.clip(roots.real, 0.0, 1.0)])
    return float(np.abs(p(places)).max())


@given(seeds, st.integers(0, 9), st.integers(1, 4))
@settings(max_examples=20)
def test_paths_and_timings_of_any_degree(seed: int, path_degree: int, timing_degree: int) -> None:
    law = ragged(seed, path_degree, timing_degree)
    certificate, seen = law.certificate, ratios(law)
    for name, ratio in seen.items():
        worst = certificate.worst[name]
        if worst.kind == "unbounded":
            assert name == "jerk"
            continue
        assert worst.kind == ("exact" if path_degree * timing_degree <= 24 else "sampled")
        assert ratio * (1.0 - 1e-12) - 1e-12 <= worst.ratio
        assert worst.ratio - worst.between <= ratio * (1.0 + 1e-3) + 1e-6


@given(seeds)
@settings(max_examples=10)
def test_smooth_laws_and_the_place_that_is_named(seed: int) -> None:
    law = smooth(seed)
    for name, ratio in ratios(law).items():
        worst = law.certificate.worst[name]
        if worst.kind == "unbounded":
            continue
        assert ratio - 1e-12 <= worst.ratio <= ratio * (1.0 + 1e-5)
        h = 1e-9 * law.duration
        state = law.at([max(worst.time - h, 0.0), min(worst.time + h, law.duration)])
        if name in ("velocity", "acceleration"):
            near = np.abs(getattr(state, name)[:, worst.joint]) / getattr(law.limits, name)[worst.joint]
            assert near.max() == pytest.approx(worst.ratio, rel=1e-5)
    assert law.certificate.ratio == max(w.ratio for w in law.certificate.worst.values())
    assert law.certificate.satisfied == (law.certificate.ratio <= 1.0 + 1e-6)


@given(seeds)
@settings(max_examples=5)
def test_derivatives_along_time_are_the_slopes_of_those_before_them(seed: int) -> None:
    """The chain rule by differences: what certificates and the dense samples above are both made of."""
    law, h = ragged(seed, 4, 3), 1e-5
    pieces, places = LawPieces.of(law.path, law.timing), np.linspace(0.1, 0.9, 5)
    for order in (1, 2, 3):
        below, above = (pieces.at(law.path, law.timing, order - 1, places + side * h) for side in (-1.0, 1.0))
        slope = (above - below) / (2.0 * h * pieces.span[:, None, None])
        found = pieces.at(law.path, law.timing, order, places)
        np.testing.assert_allclose(found, slope, rtol=0.0, atol=1e-5 * max(1.0, np.abs(slope).max()))


@cache
def pose_laws() -> list[Law]:
    random = np.random.default_rng(3)
    poses = [pin.SE3(pin.exp3(0.6 * random.normal(size=3)), random.normal(size=3)) for _ in range(5)]
    paths: list[Path] = [
        trajectory.geodesic_path(poses[0], poses[1]),
        trajectory.pose_polyline(poses, 0.1),
        trajectory.pose_spline(poses),
        *(
            trajectory.arc_path(np.eye(4), [1.0, 0.0, 0.0], [0.0, 0.0, 2.0 * np.pi * turns])
            for turns in (0.1, 3.7, 32.0)
        ),
    ]
    laws = []
    for path in paths:
        s = np.linspace(path.knots[0], path.knots[-1], 4)
        limits = MotionLimits(velocity=np.ones(6), acceleration=np.ones(6), jerk=np.ones(6))
        laws.append(Law(path, Timing.accelerations(s, np.array([0.5, 1.0, 2.0, 0.7])), limits))
        length = path.length
        laws.append(Law(path, Timing.identity(length), limits))
        laws.append(Law(path, Timing([0.0, 2.0], [[-0.25 * length], [0.75 * length], [0.0], [0.0]]), limits))
    return laws


@pytest.mark.parametrize("number", range(len(pose_laws())))
def test_poses(number: int) -> None:
    law = pose_laws()[number]
    for name, ratio in ratios(law).items():
        worst = law.certificate.worst[name]
        if worst.kind == "unbounded":
            continue
        assert worst.kind == ("exact" if law.path.degree is not None else "sampled")
        assert worst.ratio >= ratio * (1.0 - 1e-12)
        assert worst.ratio - worst.between <= ratio * (1.0 + 1e-4)
        assert worst.ratio <= ratio * (1.0 + 0.03)
        if worst.kind == "exact":
            assert worst.ratio <= ratio * (1.0 + 1e-4)


class Wave(Path):
    """q = sin(w s), w' = w + k: as many waves as one likes on a single piece."""

    dof = 1

    def __init__(self, rate: float) -> None:
        self.rate, self.knots = rate, np.array([0.0, 1.0])

    def evaluate(self, s: Any, order: int = 0, piece: Any = None) -> Any:
        return (self.rate**order * np.sin(self.rate * np.asarray(s) + 0.5 * np.pi * order))[:, None]


@given(st.floats(0.1, 20.0))
@settings(max_examples=15)
def test_functions_are_sampled_with_a_bound(rate: float) -> None:
    law = Law(Wave(rate), Timing.identity(1.0), MotionLimits(velocity=[1.0], acceleration=[1.0]), moving=(True, True))
    for name, ratio in (("velocity", rate), ("acceleration", rate**2)):
        worst = law.certificate.worst[name]
        seen = float(np.abs(getattr(law.at(np.linspace(0.0, 1.0, 20001)), name)).max())
        assert worst.kind == "sampled"
        assert seen <= worst.ratio
        assert worst.between >= 0.0
        assert worst.ratio - worst.between <= ratio * (1.0 + 1e-12)


def line(low: float, high: float) -> Law:
    """q = t for t in [0, 1], with position limits."""
    return Law(
        PolynomialPath([0.0, 1.0], [[[1.0]], [[0.0]]]), Timing.identity(1.0), MotionLimits(lower=[low], upper=[high])
    )


@pytest.mark.parametrize(
    ("low", "high", "ratio", "time"),
    [
        (-1.0, 1.0, 1.0, 1.0),
        (-2.0, 2.0, 0.5, 1.0),
        (-0.5, 0.5, 2.0, 1.0),
        (0.2, 2.0, 1.0 + 0.2 / 0.9, 0.0),
        (-np.inf, 1.0, 1.0, 1.0),
        (-np.inf, 2.0, 0.5, 1.0),
        (-np.inf, 0.5, 1.5, 1.0),
        (0.0, np.inf, 1.0, 0.0),
        (0.4, np.inf, 1.4, 0.0),
        (-4.0, np.inf, 0.0, 0.0),
    ],
)
def test_position_limits(low: float, high: float, ratio: float, time: float) -> None:
    """1 + (how far beyond) / half the range, or over the limit's own size, at least 1, where one side is open."""
    worst = line(low, high).certificate.worst["position"]
    assert worst.ratio == pytest.approx(ratio, abs=1e-12)
    assert worst.kind == "exact"
    if ratio > 0.0:
        assert worst.time == pytest.approx(time, abs=1e-9)


def test_no_position_limits_on_either_side() -> None:
    assert line(-np.inf, np.inf).certificate.worst["position"].ratio <= 0.0


def test_no_limits_no_quantities() -> None:
    law = Law(smooth(0).path, smooth(0).timing)
    assert set(law.certificate.worst) == {"jerk"}
    assert law.certificate.ratio == 0.0
    assert law.certificate.satisfied
    assert str(LawCertificate({})) == "no limits"


def test_infinite_limits_are_none() -> None:
    law = smooth(0)
    limits = MotionLimits(velocity=[np.inf, np.inf, 2.0], acceleration=np.full(3, np.inf))
    worst = law.with_limits(limits).certificate.worst
    assert worst["velocity"].joint == 2
    assert worst["acceleration"].ratio == pytest.approx(0.0, abs=1e-12)


def test_accelerations_that_jump() -> None:
    """At a break, and at a beginning and an end that are at rest before and after."""
    bang = Timing([0.0, 1.0, 2.0], [[0.5, -0.5], [0.0, 1.0], [0.0, 0.5]])
    path = PolynomialPath([0.0, 1.0], [[[1.0]], [[0.0]]])
    law = Law(path, bang, MotionLimits(acceleration=[1.0], jerk=[1.0]))
    worst = law.certificate.worst["jerk"]
    assert (worst.ratio, worst.kind, worst.time) == (np.inf, "unbounded", 1.0)
    assert not law.certificate.satisfied
    assert "jerk: unbounded" in str(law.certificate)
    half = law.sliced(0.0, 0.5)
    assert half.certificate.worst["jerk"].time == 0.0
    inner = law.sliced(0.2, 0.8)
    assert inner.certificate.worst["jerk"].kind == "exact"
    assert inner.certificate.worst["jerk"].ratio == pytest.approx(0.0, abs=1e-12)
    without = Law(path, bang, MotionLimits(acceleration=[1.0]))
    assert without.certificate.worst["jerk"].kind == "unbounded"
    assert without.certificate.satisfied


def test_the_certificate_in_words() -> None:
    law = line(-2.0, 2.0).with_limits(MotionLimits(lower=[-2.0], upper=[2.0], velocity=[4.0]))
    assert str(law.certificate) == (
        "position 0.5000000 at 1 s, joint 0, exact; velocity 0.2500000 at 0 s, joint 0, exact"
    )
