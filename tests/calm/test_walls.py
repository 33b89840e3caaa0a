"""Along walls, in corners and between obstacles: no vibration, no relaxed tick, no limit passed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.calm.scenes import Array, built, machine, run, tip_pose
from tests.repeats import covering

DT = 0.005
GAINS = (2.0, 10.0, 50.0, 200.0)

#: Where the hand is pulled to: behind the wall, into the corner, through the gap
PULLS = {"wall": (0.7, 0.0, 0.4), "corner": (0.7, 0.5, 0.4), "between": (0.7, 0.0, 0.45)}


def towards(place: Callable[[float], tuple[float, float, float]]) -> Callable[[float], tuple[Any, Array]]:
    robot = machine("panda")
    home = tip_pose(robot, robot.neutral, "panda")

    def target(t: float) -> tuple[Any, Array]:
        pose = home.copy()
        pose.translation = np.array(place(t))
        return pose, np.zeros(6)

    return target


@pytest.mark.parametrize(("scene", "gain"), covering(PULLS, GAINS))
def test_comes_to_rest(scene: str, gain: float) -> None:
    done = run(built("panda", DT, scene=scene), gain, towards(lambda t: PULLS[scene]), 1200)
    assert done.unsolved == 0
    assert done.margin.min() > -1e-5
    assert done.margin.min() < 0.02, "the hand is pulled to the obstacle"
    assert done.flips(100, above=1e-6) == 0
    assert np.abs(done.v[-100:]).max() < 1e-3
    assert (np.abs(done.acceleration) <= machine("panda").limits.acceleration * (1 + 1e-9)).all()


@pytest.mark.parametrize(("scene", "gain"), covering(["wall", "corner"], GAINS))
def test_slides(scene: str, gain: float) -> None:
    """A target that swings behind the wall, or in and out of the corner: the hand slides without shaking."""
    swing = {
        "wall": lambda t: (0.6, 0.3 * np.sin(1.5 * t), 0.4),
        "corner": lambda t: (0.6, 0.25 + 0.2 * np.sin(2 * t), 0.4),
    }[scene]
    done = run(built("panda", DT, scene=scene), gain, towards(swing), 1600)
    assert done.unsolved <= 5
    assert done.margin.min() > -1e-4
    assert (np.abs(done.acceleration) <= machine("panda").limits.acceleration * (1 + 1e-9)).all()
    # a swing turns each joint round a few times; shaking would do so every few ticks
    assert done.flips(1200, above=1e-3) <= 7 * 12


@pytest.mark.parametrize(("scene", "gain"), covering(["wall", "corner"], GAINS))
def test_a_servo_that_lags_does_not_bounce(scene: str, gain: float) -> None:
    """20 ms of lag: less than a millimetre into the wall, then rest."""
    done = run(built("panda", DT, scene=scene), gain, towards(lambda t: PULLS[scene]), 1200, lag=0.02)
    assert done.margin.min() > -1e-3
    assert done.flips(100, above=1e-6) == 0
    assert np.abs(done.v[-100:]).max() < 1e-3


def test_noise_at_a_wall_stays_small() -> None:
    done = run(built("panda", DT, scene="wall"), 10.0, towards(lambda t: PULLS["wall"]), 1200, lag=0.02, noise=1e-4)
    assert done.margin.min() > -2e-3
    assert np.abs(done.v[-300:]).max() < 0.05


@pytest.mark.parametrize("rate", [5.0, 20.0])
def test_a_ball_that_comes_by_is_given_way_no_earlier_than_needed(rate: float) -> None:
    """Links that can hardly move away from it ask nothing of the joints: no more way than the plain model gives."""
    robot, pushed = machine("panda"), {}
    for calm in (True, False):
        controller = built("panda", DT, calm=calm, scene="passing")
        home, velocity, q = tip_pose(robot, robot.neutral, "panda"), np.array([0.0, -0.3, 0.0]), robot.neutral
        controller.reset(q)
        controller["hand"].set(target=home, gain=5.0)
        controller["ball"].set(rate=rate, velocity=[*velocity, 0.0, 0.0, 0.0])
        off, least, statuses = [], np.inf, set()
        for k in range(1000):
            controller["ball"].pose = pin.SE3(np.eye(3), np.array([0.42, 0.7, 0.45]) + velocity * k * DT)
            step = controller.step(q)
            statuses.add(step.status)
            off.append(float(np.linalg.norm(tip_pose(robot, q, "panda").translation - home.translation)))
            least = min(least, float(step.margins["ball"].min()))
            q = pin.integrate(robot.model, q, step.v * DT)
        assert statuses == {"solved"}
        assert least > -1e-5
        assert off[-1] < 1e-4
        pushed[calm] = max(off)
    assert 0.005 < pushed[True] < pushed[False] + 1e-3


def test_the_plain_model_relaxes_there() -> None:
    """What braking in front of margins is for: the same scene without it."""
    done = run(built("panda", DT, calm=False, scene="wall"), 10.0, towards(lambda t: PULLS["wall"]), 600)
    assert done.unsolved > 5
