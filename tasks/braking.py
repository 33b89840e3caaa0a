"""How fast a joint may go towards a limit so that it can still stop in time, in discrete time.

A command v is held for one tick of length t, then the speed falls by at most a times the length of each
following tick. With distance d to the limit:

    any tick lengths     v t + v^2 / (2 a) <= d
    ticks of at least s  v t + max over n >= 0 of (n v s - a s^2 n (n + 1) / 2) <= d        (s <= t)

The first is the second for s -> 0. Both are solved for the largest v below; the second with s = t is
v = d / (n t) + (n - 1) a t / 2 with n = max(1, ceil((sqrt(1 + 8 d / (a t^2)) - 1) / 2)).

Why the sums are right. Braking from u over ticks t1, t2, ... travels sum (u - a Tk)+ tk, Tk = t1 + ... + tk:
a right Riemann sum of the falling line u - a T, so it is below the area u^2 / (2 a). When no tick is shorter
than s the longest travel is that of ticks s, phi(u) = max over n of (n u s - a s^2 n (n + 1) / 2), because

    phi(u) >= (u - a t)+ t + phi((u - a t)+)     for every t >= s.                                   (1)

(With x = u / (a s) - t / s and m = t / s, phi' = s floor(u / (a s)) turns (1), where u >= a t, into
integral of floor from x to x + m >= m x. It holds with equality for m = 1, and the left side grows with m at
floor(x + m) > x + m - 1 >= x, the right side at x. For u < a t the right side is 0.) u^2 / (2 a) has
the same property for every t > 0.

Why the bound never contradicts the acceleration limit. Call a state viable if phi(v) <= d. A command within
the bound, v t + phi(v) <= d, leaves d - v t >= phi(v): viable. From a viable state the command v - a t is
within the bound of any next tick t, which is (1). So braking fully is always allowed, the interval of
allowed commands is never empty, and d never becomes negative.
"""

from __future__ import annotations

import math

import casadi as ca

#: A brake takes no more ticks than this in the formula for ticks of a least length; keeps n^2 finite.
MOST_TICKS = 1e9


def braking_bound(distance: ca.SX, acceleration: float | ca.SX, dt: ca.SX, shortest_dt: float | None = None) -> ca.SX:
    """The largest speed towards a limit ``distance`` away from which braking still stops in time.

    v = 2 d / (t + sqrt(t^2 + 2 d / a)); with ``shortest_dt`` = s the larger
    v = (d + a s^2 n (n + 1) / 2) / (t + n s), n = max(0, ceil((sqrt((2 r - 1)^2 + 8 d / (a s^2)) - 2 r - 1) / 2)),
    r = t / s. See the module's text for the proof. Elementwise.

    Args:
        distance: d >= 0 [rad or m], finite.
        acceleration: a >= 0 [rad/s^2 or m/s^2]; inf: v = d / t; 0: v = 0.
        dt: length t > 0 of the tick that the speed is held for [s].
        shortest_dt: no later tick is shorter than this [s]; None: later ticks may have any length. A tick
            that is itself shorter counts as the least one.

    Returns:
        Speed [rad/s or m/s], >= 0, and 0 where d = 0.
    """
    if isinstance(acceleration, (int, float)):
        if math.isinf(acceleration):
            return distance / dt
        if acceleration == 0.0:
            return ca.SX.zeros(*distance.shape)
    if shortest_dt is None:
        return 2 * distance / (dt + ca.sqrt(dt * dt + (2 / acceleration) * distance))
    least = ca.fmin(dt, shortest_dt)
    twice, step = 2 * dt / least, acceleration * least * least
    ticks = ca.ceil((ca.sqrt((twice - 1) ** 2 + 8 * distance / step) - twice - 1) / 2)
    ticks = ca.fmin(ca.fmax(ticks, 0), MOST_TICKS)
    return (distance + step * ticks * (ticks + 1) / 2) / (dt + ticks * least)


def clip(value: ca.SX, lower: ca.SX, upper: ca.SX) -> ca.SX:
    """The point of [lower, upper] nearest to ``value``; elementwise, lower <= upper."""
    return ca.fmin(ca.fmax(value, lower), upper)
