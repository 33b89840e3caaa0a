"""Random calls of everything public: each answers, or refuses with a WbcError, in time; and objects work afterwards.

A long run: ``make soak``.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import wbc
from tests.fuzz.arm import robot
from tests.fuzz.goods import Goods
from tests.fuzz.hostile import spoiled
from tests.fuzz.surface import MODULES, Callee, Hang, attempt, calls, impatient, surface
from tests.repeats import repeats


def test_every_call_answers_or_refuses() -> None:
    ((_, counts),) = calls(0, 0, repeats(1))
    assert {key: n for key, n in counts.items() if key.startswith("wrong")} == {}
    ends = Counter({end: sum(n for key, n in counts.items() if key.startswith(end)) for end in ("answered", "refused")})
    assert min(ends.values()) > 100, ends


def test_the_walk_meets_what_users_call(tmp_path) -> None:
    goods = Goods(tmp_path)
    found = {callee.name for callee in surface(goods)}
    assert len(found) > 150
    # One of every kind: functions, classes, methods, setters, operators of objects that the walk makes
    assert found >= {
        "robots.load", "trajectory.load", "proximity.distances", "DHRow", "PlacedShape", "Input", "EndEffector",
        "Robot.with_self_pairs", "Controller.step", "Controller.__contains__", "Handle.target=",
        "InverseKinematics.along",
        "Adviser", "PairController.step", "analysis.certify", "track.track", "Teleoperation.step",
        "TaskPriority.resolve",
        "Step.derivative", "Law.then", "PolynomialPath.evaluate", "Online.step", "Recording.__getitem__",
    }  # fmt: skip
    every = {*wbc.tasks.registry(), *(n for m in MODULES for n in getattr(wbc, m.removeprefix("wbc."), wbc).__dict__)}
    assert {name for name in wbc.tasks.registry() if name in wbc.tasks.__all__} <= found & every


def test_bare_errors_hangs_warnings_and_nan_are_told(tmp_path) -> None:
    goods, rng = Goods(tmp_path), np.random.default_rng(0)

    def forever(q):
        while True:
            pass

    def raises(q):
        return {}[object()]

    def warns(q):
        return np.float64(1e200) * np.array(1e200)

    def gives_nan(q):
        return np.full(3, np.nan)

    told = {}
    for each in (raises, warns, gives_nan):
        callee = Callee(each.__name__, "", lambda _, each=each: each)
        told[each.__name__] = attempt(callee, goods, rng)
    assert all(text.startswith(f"wrong: {name}") for name, text in told.items()), told
    with pytest.raises(Hang), impatient(0.05):
        forever(None)


def test_an_object_that_was_harmed_is_told(tmp_path, monkeypatch) -> None:
    goods = Goods(tmp_path)
    assert goods.harmed("robot") == ""
    monkeypatch.setattr(type(robot()), "configuration", lambda self, field, q: np.zeros(3))
    assert goods.harmed("robot") == "another answer than before"


def test_spoiled_values_differ_from_good_ones() -> None:
    rng = np.random.default_rng(1)
    for good in (1.0, "name", np.ones(3), [1.0, 2.0], {"a": 1.0}, None, True):
        different = sum(repr(spoiled(good, rng)) != repr(good) for _ in range(50))
        assert different > 45
