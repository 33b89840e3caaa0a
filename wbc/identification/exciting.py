"""Motions that show as much of the base parameters as the limits of a robot let them.

    maximise  log det (W'W / (m noise^2))        over waypoints of a cubic spline that begins and ends at rest

W is the stacked regressor of the base parameters at m instants, each row in units of its torque's noise (D-optimal).
The law runs along the spline at the constant rate at which velocities, accelerations and torques of the model keep
their limits, exactly for the first two (its certificate), at the instants for torques. A search by random steps: the
answer is good, not proven best. Source: Swevers et al. 1997, Optimal robot excitation and identification.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import InfeasibleError, UnsupportedJointError
from wbc.identification.parameter_base import BaseParameters, base_parameters, identifiable
from wbc.identification.regression import Regression
from wbc.multibody import pin
from wbc.trajectory import Law, MotionLimits, Timing, spline_path
from wbc.validation import Array

#: Samples of a motion in the search
INSTANTS = 60
#: Random motions that are tried first
FIRST = 20
#: Part of the limits that a motion uses
SHARE = 0.8
#: Acceleration of joints that have no limit [rad/s^2, m/s^2]
ACCELERATION = 10.0
#: Size of the first random steps, as a part of the joints' ranges
STEP = 0.3
#: Factor by which random steps shrink where nothing better is found
SHRINK = 0.9
#: Half the range of joints without limits [rad, m]
FREE = 1.5


@dataclass(frozen=True, eq=False)
class ExcitingMotion:
    """A motion and what it shows.

    Attributes:
        law: with its certificate. base: base parameters that it shows. score: the log det that was maximised.
        first: the best of the first random motions', for comparison.
    """

    law: Law
    base: BaseParameters
    score: float
    first: float


def exciting_motion(
    regression: Regression,
    *,
    waypoints: int = 8,
    noise: Array | float = 1.0,
    tries: int = 300,
    seed: int = 0,
    tick: Callable[[], None] = lambda: None,
) -> ExcitingMotion:
    """Look for a motion that shows much.

    Args:
        regression: of a robot on a fixed base whose coordinates are those of its velocities. waypoints: of the spline,
            besides both ends. noise: of torques, a standard deviation each [N m or N]. tries: motions that are looked
            at. tick: called after each.

    Raises:
        UnsupportedJointError: a base that moves, or joints with coordinates of another number. InfeasibleError:
            gravity alone takes more than the limits of torque along all motions that were tried. ShapeError,
            NotFiniteError, RangeError: numbers out of range.
    """
    robot = regression.robot
    if robot.base != "fixed" or robot.nq != robot.nv:
        raise UnsupportedJointError("robot", robot.name, "expected a fixed base and joints of one coordinate each")
    count = validation.integer("waypoints", waypoints, low=2)
    tries = validation.integer("tries", tries, low=1)
    sigma = np.broadcast_to(validation.ordinary_array("noise", noise), (robot.nv,))
    random = np.random.default_rng(validation.integer("seed", seed))
    limits = robot.limits
    known = np.isfinite(limits.position_upper - limits.position_lower) & (limits.position_upper > limits.position_lower)
    middle = np.where(known, (limits.position_lower + limits.position_upper) / 2.0, robot.neutral)
    half = np.where(known, (limits.position_upper - limits.position_lower) / 2.0, FREE)
    half = SHARE * np.minimum(half, np.pi)
    base = identifiable(regression, seed=seed)
    search = _Excitation(regression, base, sigma)

    def judged(points: Array) -> tuple[float, Law | None]:
        tick()
        return search.score(np.vstack([middle, middle + half * points, middle]))

    best, score, law = None, -np.inf, None
    for _ in range(min(FIRST, tries)):
        points = random.uniform(-1.0, 1.0, (count, robot.nv))
        value, found = judged(points)
        if value > score:
            best, score, law = points, value, found
    first, step = score, STEP
    for _ in range(tries - FIRST):
        if best is None:
            break
        moved = np.clip(best + step * random.normal(size=best.shape) * (random.random(best.shape) < 0.5), -1.0, 1.0)
        value, found = judged(moved)
        if value > score:
            best, score, law = moved, value, found
        else:
            step = max(0.02, step * SHRINK ** (1.0 / 4.0))
    if law is None:
        said = "no motion that was tried keeps the limits of torque"
        raise InfeasibleError("robot.limits.effort", limits.effort, said)
    times = np.linspace(0.0, law.duration, 4 * INSTANTS)
    return ExcitingMotion(law, base_parameters(regression.matrix(*law.at(times))), score, first)


class _Excitation:
    """What a spline through waypoints shows."""

    def __init__(self, regression: Regression, base: BaseParameters, sigma: Array) -> None:
        self.regression, self.base, self.sigma = regression, base, sigma
        limits, robot = regression.robot.limits, regression.robot
        bounded = limits.position_upper > limits.position_lower
        self.limits = MotionLimits(
            np.where(bounded & np.isfinite(limits.position_lower), limits.position_lower, -1e3),
            np.where(bounded & np.isfinite(limits.position_upper), limits.position_upper, 1e3),
            np.where(np.isfinite(limits.velocity) & (limits.velocity > 0.0), SHARE * limits.velocity, 1e3),
            np.where(np.isfinite(limits.acceleration), SHARE * limits.acceleration, ACCELERATION),
        )
        # An effort of 0 is one that the description does not state
        self.effort = np.where(limits.effort > 0.0, SHARE * limits.effort, np.inf)
        self.data = robot.model.createData()

    def score(self, waypoints: Array) -> tuple[float, Law | None]:
        """log det, and the law; none where a limit cannot be kept."""
        path = spline_path(waypoints, "clamped")
        law = Law(path, Timing.identity(float(path.knots[-1] - path.knots[0]), float(path.knots[0])), self.limits)
        worst = law.certificate.worst
        if worst["position"].ratio > 1.0:
            return -np.inf, None
        pace = max(worst["velocity"].ratio, float(np.sqrt(worst["acceleration"].ratio)))
        law = law.scaled(pace)
        model, times = self.regression.robot.model, np.linspace(0.0, law.duration, INSTANTS)
        for _ in range(8):
            q, v, a = law.at(times)
            torques = np.array([pin.rnea(model, self.data, *state) for state in zip(q, v, a, strict=True)])
            share = float((np.abs(torques) / self.effort).max())
            if share <= 1.0:
                break
            law, times = law.scaled(1.2), 1.2 * times
        else:
            return -np.inf, None
        W = self.regression.matrix(q, v, a)[:, list(self.base.columns)] / np.tile(self.sigma, INSTANTS)[:, None]
        # What is shown in a given time counts: a slow motion has more samples
        sign, value = np.linalg.slogdet(W.T @ W * (law.duration / INSTANTS))
        return (float(value), law) if sign > 0.0 else (-np.inf, None)
