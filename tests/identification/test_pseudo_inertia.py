"""What is a body and what is none, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.refusals import assert_refused
from wbc.errors import RangeError
from wbc.identification.pseudo_inertia import (
    checked_body,
    is_body,
    nearest_body,
    parameters,
    pseudo_inertia,
)


def random_body(seed: int) -> np.ndarray:
    return np.array(pin.LogCholeskyParameters(np.random.default_rng(seed).normal(size=10)).toDynamicParameters())


@pytest.mark.parametrize("seed", range(5))
def test_pseudo_inertia(seed: int) -> None:
    """There and back, as Pinocchio has it."""
    phi = random_body(seed)
    np.testing.assert_allclose(pseudo_inertia(phi), pin.PseudoInertia.FromDynamicParameters(phi).toMatrix(), atol=1e-10)
    np.testing.assert_allclose(parameters(pseudo_inertia(phi)), phi, atol=1e-12 * np.abs(phi).max())


def test_what_is_no_body() -> None:
    """A negative mass; moments of which one is above the sum of the others."""
    good = np.array([2.0, 0, 0, 0, 1.0, 0, 1.0, 0, 0, 1.0])
    assert is_body(good)
    thin = good.copy()
    thin[4] = 2.1
    assert not is_body(thin)
    assert_refused(lambda: checked_body("link", thin), RangeError, "positive definite")
    light = good.copy()
    light[0] = -1.0
    assert_refused(lambda: checked_body("link", light), RangeError, "link.mass")


@pytest.mark.parametrize("seed", range(5))
def test_nearest_body(seed: int) -> None:
    """A body stays; else no other one of many is nearer in the metric."""
    rng = np.random.default_rng(seed)
    scale = pseudo_inertia(random_body(seed))
    body = pseudo_inertia(random_body(seed + 10))
    np.testing.assert_array_equal(nearest_body(body, scale), body)
    none = body - 3.0 * np.trace(body) * np.outer(*[rng.normal(size=4)] * 2) / 4.0
    found, inverse = nearest_body(none, scale), np.linalg.inv(scale)

    def far(P: np.ndarray) -> float:
        return float(np.trace(inverse @ (P - none) @ inverse @ (P - none)))

    assert np.linalg.eigvalsh(found)[0] > -1e-9 * np.abs(none).max()
    for _ in range(100):
        other = rng.normal(size=(4, 4))
        assert far(found) <= far(found + 0.1 * rng.uniform() * (other @ other.T - found)) + 1e-9 * far(none)
