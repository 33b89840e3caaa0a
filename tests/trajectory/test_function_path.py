"""Paths from functions: near them where nobody looked, the derivatives with them; what is not smooth is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.trajectory.path_checks import steps_at_knots, worst_derivative
from wbc.errors import ContinuityError
from wbc.trajectory import function_path
from wbc.validation import Array


def curve(x: float) -> Array:
    return np.array([np.sin(3.0 * x), np.cos(5.0 * x), x * x])


def slopes(x: Array, order: int) -> Array:
    """Derivatives of the curve."""
    quarter = 0.5 * np.pi * order
    powers = {1: 2.0 * x, 2: np.full_like(x, 2.0), 3: np.zeros_like(x)}
    parts = (3.0**order * np.sin(3.0 * x + quarter), 5.0**order * np.cos(5.0 * x + quarter), powers[order])
    return np.stack(parts, axis=1)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
def test_near_the_function_everywhere(tolerance: float) -> None:
    path = function_path(curve, -1.0, 2.0, tolerance)
    s = np.random.default_rng(1).uniform(0.0, path.length, 2000)
    expected = np.array([curve(x) for x in path.argument(s).tolist()])
    off = np.linalg.norm(path.evaluate(s) - expected, axis=1).max()
    assert off <= 1.1 * path.deviation + 1e-15
    assert path.deviation <= tolerance
    assert path.degree == 5
    assert path.start == -1.0
    assert path.end == 2.0
    np.testing.assert_allclose(path.evaluate(path.knots[[0, -1]]), [curve(-1.0), curve(2.0)], atol=1e-14)


def test_derivatives_are_those_of_the_function() -> None:
    path = function_path(curve, -1.0, 2.0, 1e-9)
    s = np.linspace(0.0, path.length, 500)
    factor = 3.0 / path.length
    for order, tolerance in ((1, 2e-7), (2, 1e-5), (3, 1e-2)):
        expected = factor**order * slopes(path.argument(s), order)
        assert np.abs(path.evaluate(s, order) - expected).max() < tolerance
        assert worst_derivative(path, order) < 1e-8
    for order in range(4):
        assert steps_at_knots(path, order) < 1e-6


def test_s_has_the_length_of_the_way() -> None:
    path = function_path(lambda x: [np.cos(x), np.sin(x)], 0.0, 2.0)
    assert path.length == pytest.approx(2.0, rel=1e-3)
    far = function_path(lambda x: [1e-3 * x, 0.0], 0.0, 1e4)
    assert far.length == pytest.approx(10.0, rel=1e-12)
    assert np.linalg.norm(far.evaluate(np.array([5.0]), 1)) == pytest.approx(1.0, rel=1e-12)


def test_tiny_and_narrow_functions() -> None:
    tiny = function_path(lambda x: [3.0 + 1e-8 * x, 1e-8 * np.sin(x)], 0.0, 1.0)
    assert tiny.deviation < 1e-14
    assert tiny.length == pytest.approx(1.3e-8, rel=0.1)
    narrow = function_path(lambda x: [np.exp(-(((x - 0.371) / 0.003) ** 2))], 0.0, 1.0)
    s = np.array([0.371 * narrow.length])
    assert narrow.evaluate(s)[0, 0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("waves", [8, 16, 32, 64])
def test_functions_that_repeat_with_the_samples(waves: int) -> None:
    path = function_path(lambda x: [np.sin(2.0 * np.pi * waves * x)], 0.0, 1.0)
    s = np.linspace(0.0, path.length, 1001)
    expected = np.sin(2.0 * np.pi * waves * path.argument(s))
    np.testing.assert_allclose(path.evaluate(s)[:, 0], expected, atol=1e-6)


def test_a_constant_stands() -> None:
    path = function_path(lambda x: (1.0, 2.0), 0.0, 5.0)
    assert path.degree == 0
    assert path.knots.tolist() == [0.0, 1.0]
    assert path.deviation == 0.0
    assert path.evaluate(np.array([0.4])).tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize(
    ("function", "tolerance"),
    [
        (lambda x: [abs(x - 0.3)], 1e-6),
        (lambda x: [abs(x - 0.3)], 1e-2),
        (lambda x: [float(x > 0.3)], 1e-6),
        (lambda x: [float(x > 0.3)], 0.9),
        (lambda x: [0.3 + np.sqrt(abs(x - 0.3))], 1e-6),
    ],
    ids=["corner", "corner within the tolerance", "step", "step within the tolerance", "root"],
)
def test_what_is_not_smooth_is_refused_with_its_place(function: Any, tolerance: float) -> None:
    with pytest.raises(ContinuityError, match="not smooth enough") as told:
        function_path(function, 0.0, 1.0, tolerance, intervals=1024)
    assert told.value.value == pytest.approx(0.3, abs=2e-3)


def test_errors_of_the_function_come_through() -> None:
    with pytest.raises(ZeroDivisionError):
        function_path(lambda x: [1.0 / x], 0.0, 1.0)
