"""Classical rate resolution beside pairs of coordinates: a drive of the Space Station arm, there and back."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from bench.sheet import Sheet
from wbc.coordinates import Adviser, AutomaticPairs, CoordinatePair, PairController, expressions, parts
from wbc.errors import WbcError
from wbc.resolvers import (
    ExtendedJacobian,
    GradientProjection,
    PseudoInverse,
    RankReduction,
    RateProblem,
    TaskPriority,
    VirtualArms,
)

PARTS = parts("ssrms")
ARM, ROBOT = PARTS.arms[0], PARTS.robot
HELD = {str(one): one for one in ARM.candidates()}
assert ARM.middle is not None
assert ARM.alpha is not None
ELBOW, ALPHA = ARM.middle, ARM.alpha
#: The tip's commands are those of this motion of the joints, which takes joint 2 through 90 degrees, and back
START = np.array([0.3, 1.3, -0.5, 1.2, 0.7, -0.6, 0.9])
SLOW = np.array([0.0, 0.02, 0.004, -0.008, 0.004, 0.006, -0.004])
DT, SECONDS = 0.02, 25.0

Method = Callable[[np.ndarray, np.ndarray], np.ndarray]


def tip_rates(q: np.ndarray) -> np.ndarray:
    """J of the tip's pose, pitch plane, elbow, in this order [10, 7]."""
    return np.asarray(_rates(q).full())


_rates = expressions.rate_function(ROBOT, (ARM.tip, ALPHA, ELBOW))


def methods() -> dict[str, Callable[[], Method]]:
    """Name -> what makes a fresh method, a function of configuration and command."""

    def plain(make: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Callable[[], Method]:
        return lambda: lambda q, command: make(tip_rates(q), command)

    def pair(*names: str) -> Callable[[], Method]:
        return lambda: _pair_method(names)

    weight = np.array([4.0, 4.0, 1.0, 1.0, 1.0, 0.5, 0.5])
    return {
        "pseudo-inverse": plain(lambda J, c: PseudoInverse().resolve(RateProblem(J[:6], c))),
        "weighted": plain(lambda J, c: PseudoInverse(weight).resolve(RateProblem(J[:6], c))),
        "damped, 0.01": plain(lambda J, c: PseudoInverse(damping=0.01).resolve(RateProblem(J[:6], c))),
        "gradient projection to the start": lambda: (
            lambda q, c: GradientProjection(0.2 * (q - START)).resolve(RateProblem(tip_rates(q)[:6], c))
        ),
        "task priority, elbow still": plain(lambda J, c: TaskPriority(1e-3).resolve(RateProblem(J[:6], c, J[7:]))),
        "extended Jacobian, alpha": plain(lambda J, c: ExtendedJacobian().resolve(RateProblem(J[:6], c, J[6:7]))),
        "extended, damped 0.01": plain(lambda J, c: ExtendedJacobian(0.01).resolve(RateProblem(J[:6], c, J[6:7]))),
        "rank reduction, joint 1": plain(lambda J, c: RankReduction((0,)).resolve(RateProblem(J[:6], c))),
        "rank reduction, best joint": plain(lambda J, c: RankReduction().resolve(RateProblem(J[:6], c))),
        "virtual arms, alpha exact": plain(lambda J, c: VirtualArms().resolve(RateProblem(J[:6], c, J[6:7]))),
        "pair {xi; alpha}, joint limits": pair("alpha"),
        "pairs {alpha, beta} by adviser": pair("alpha", "beta"),
    }


def _pair_method(names: tuple[str, ...]) -> Method:
    pairs = [CoordinatePair(ARM.tip, HELD[name], name) for name in names]
    control = PairController(ROBOT, pairs, DT)
    auto = AutomaticPairs(control, Adviser(ROBOT, pairs, exact=False), seconds=2.0)
    control.reset(START)

    def method(q: np.ndarray, command: np.ndarray) -> np.ndarray:
        auto.command(command)
        return auto.step(q).v

    return method


def drive(make: Callable[[], Method], seconds: float = SECONDS) -> tuple[str | float, float, float, float]:
    """There and back: median time of a resolution [us], or why it failed; the fastest joint rate [rad/s]; the largest
    difference of the tip's twist from its command [m/s, rad/s], and of a joint from its start after the way back [rad].
    """
    method, q, ticks = make(), START.copy(), round(seconds / DT)
    spent, fastest, lost = [], 0.0, 0.0
    for tick in range(2 * ticks):
        k, sign = (tick, 1.0) if tick < ticks else (2 * ticks - tick, -1.0)
        command = sign * tip_rates(START + SLOW * k * DT)[:6] @ SLOW
        began = time.perf_counter()
        try:
            v = method(q, command)
        except WbcError as error:
            return f"failed: {error}", fastest, lost, np.nan
        spent.append(time.perf_counter() - began)
        fastest = max(fastest, float(np.abs(v).max()))
        lost = max(lost, float(np.abs(tip_rates(q)[:6] @ v - command).max()))
        q = q + DT * v
    return 1e6 * float(np.median(spent)), fastest, lost, float(np.abs(q - START).max())


def parts() -> dict[str, Sheet | str]:
    """A row a method."""
    rows = []
    for name, make in methods().items():
        took, fastest, lost, away = drive(make)
        ends = (took, "") if isinstance(took, str) else (f"{took:.0f}", f"{away:.2g}")
        rows.append((name, ends[0], f"{fastest:.3g}", f"{lost:.2g}", ends[1]))
    units = ("fastest joint [rad/s]", "twist lost [m/s, rad/s]", "after the return [rad]")
    return {"drive": Sheet("", ("method", "one resolution [us]", *units), rows)}
