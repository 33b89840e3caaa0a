"""Motions of objects: their twists and accelerations against finite differences, their spectrum, and free bodies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import slope
from wbc.moving_target.motions import TargetMotion, Tumble, Waves, sea, swing, tumble

MEAN = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.2])), np.array([0.5, 0.1, 0.3]))
HEIGHTS = np.array([0.04, 0.05, 0.06, 0.07, 0.08, 0.09])


def made(name: str, seed: int = 0) -> TargetMotion:
    rng = np.random.default_rng(seed)
    if name == "tumble":
        return tumble(MEAN, rng, np.radians(3.0), 0.4, 0.01, 20.0)
    return sea(MEAN, rng, HEIGHTS, 6.0) if name == "sea" else swing(MEAN)


@pytest.mark.parametrize("name", ["sea", "swing", "tumble"])
def test_twist_and_acceleration_are_the_derivatives(name: str) -> None:
    motion = made(name)
    for t in (0.7, 5.3, 11.9):
        here = motion.at(t)
        turn = here.pose.rotation

        def place(s: float, t: float = t, turn: np.ndarray = turn) -> np.ndarray:
            pose = motion.at(t + s).pose
            return np.concatenate([pose.translation, pin.log3(pose.rotation @ turn.T)])

        assert np.allclose(here.twist, slope(place, 1e-3), atol=1e-8)
        assert np.allclose(here.acceleration, slope(lambda s, t=t: motion.at(t + s).twist, 1e-3), atol=1e-6)


def test_a_sea_has_its_significant_heights() -> None:
    """Four standard deviations, over many seas; the band that is left out has a tenth of the variance."""
    deviations = np.zeros(6)
    for seed in range(40):
        waves = made("sea", seed)
        assert isinstance(waves, Waves)
        deviations += (waves.amplitude**2).sum(axis=0) / 2 / 40
    assert np.allclose(4.0 * np.sqrt(deviations), HEIGHTS, rtol=0.08)


def test_a_free_body_keeps_its_angular_momentum_and_its_energy() -> None:
    body = made("tumble")
    assert isinstance(body, Tumble)
    assert np.allclose(body.at(0.0).pose.homogeneous, MEAN.homogeneous, atol=1e-12)
    momenta, energies, centres = [], [], []
    for t in np.linspace(0.0, 20.0, 9):
        here = body.at(float(t))
        turn, spin = here.pose.rotation, here.twist[3:]
        momenta.append(turn @ (body.inertia * (turn.T @ spin)))
        energies.append(momenta[-1] @ spin)
        centres.append(here.pose.translation - turn @ body.arm - body.drift * t)
    for kept in (momenta, energies, centres):
        assert np.allclose(kept, kept[0], rtol=1e-8, atol=1e-12)
    assert np.linalg.norm(body.at(0.0).twist[3:]) == pytest.approx(np.radians(3.0))


def test_the_published_swing() -> None:
    motion = swing(pin.SE3.Identity())
    assert np.allclose(motion.at(2.5).pose.translation, [0.0508, 0.0, 0.0])
    assert np.allclose(pin.log3(motion.at(5.0).pose.rotation), [0.0, 0.0, np.radians(5.0)])
