"""Which accelerations a joint may have so that its limits hold for ever, in discrete time.

An acceleration a is held for one tick of length t <= T: q(t) = q + v t + a t^2 / 2 and v(t) = v + a t, exactly. With
limits l <= q <= u, |v| <= V, |a| <= A let

    B = min(A, V / T, 2 (u - l) / (3 T^2))                      the deceleration that braking counts on

and call a state viable if l <= q <= u, |v| <= V, v^2 <= 2 B (u - q) where v > 0 and v^2 <= 2 B (q - l) where v < 0. The
accelerations that are allowed lead to a viable state, and pass no limit on the way: an interval, as every condition is
of the form a <= a_u or a >= a_l. With d = u - q and c = d - v t / 2, for the upper limit

    a_u = (w - v) / t,      w = 4 c / (t + sqrt(t^2 + 8 c / B)) for c >= 0,      w = v - v^2 t / (2 d) for c < 0

w >= 0 is the fastest velocity at the end of the tick that can still be stopped; for c < 0 the joint turns round on
the limit within the tick. The lower limit is the mirror image.

Why the interval is never empty from a viable state, for every t in (0, T]. Let v >= 0, the other case is the mirror
image.

If v >= B t, or d < v t / 2, take a = -B. Braking at B follows the parabola v^2 + 2 B q = const, so the state stays on
its side of that of the upper limit, and turns round before it. The velocity at the end is at least -B T >= -V. For the
lower limit nothing is asked where it is >= 0. Else v < B t and d < v t / 2 < B t^2 / 2, so that by the choice of B
q - l > u - l - B t^2 / 2 >= B t^2, and (v - B t)^2 <= 2 B (q(t) - l) is the same as
v^2 - 4 B v t + 2 B^2 t^2 <= 2 B (q - l), whose left side is at most 2 B^2 t^2 for 0 <= v <= B t.

If v < B t and d >= v t / 2, take a = -v / t, which ends at rest within the limits.

So one acceleration is within all bounds, |a| <= B <= A. In contrast to Del Prete (Joint position and velocity bounds in
discrete-time acceleration/torque control of robot manipulators, IEEE RA-L 3(1), 2018) t may be another one in every
tick, because B and what is viable do not depend on it.
"""

from __future__ import annotations

import math

import casadi as ca

from wbc.tasks.braking import clip

#: Distances to a limit below this count as this [rad or m]: v^2 / d is finite
LEAST = 1e-12
#: Braking counts on this at least [rad/s^2 or m/s^2]: distances are divided by it
WEAKEST = 1e-3


def stopping_deceleration(acceleration: float, velocity: float, width: float, longest: float) -> float:
    """B of the module; infinite where nothing is limited."""
    return min(acceleration, velocity / longest, width / (1.5 * longest**2))


def allowed_accelerations(
    q: ca.SX,
    v: ca.SX,
    dt: ca.SX,
    *,
    position: tuple[float, float],
    velocity: float,
    acceleration: float,
    velocity_scale: ca.SX,
    return_rate: ca.SX,
    longest: float,
    motor: ca.SX | None = None,
    braking: float = math.inf,
) -> tuple[ca.SX, ca.SX]:
    """The interval of the module for one coordinate, lower <= upper always. Infinite limits cost no operation.

    From a state that is not viable it is the end of the acceleration limits, or of the velocity limits where there are
    none, that is nearest to what the limits ask for; from outside the position limits a joint brakes, then returns at
    ``return_rate`` times the violation at least, but no faster than it can stop. ``motor`` is a deceleration that may
    change with the state, such as that which a motor has: B is no more than that, and a state may cease to be viable.
    Nor is B more than ``braking``.
    """
    low, high = -ca.SX.inf(1), ca.SX.inf(1)
    if math.isfinite(velocity):
        most = velocity_scale * velocity
        low, high = (-most - v) / dt, (most - v) / dt
    if math.isfinite(acceleration):
        most_a = ca.SX(acceleration)
        low, high = clip(low, -most_a, most_a), clip(high, -most_a, most_a)
    bounded = math.isfinite(velocity) or math.isfinite(acceleration)
    most_b = min(acceleration, braking)
    deceleration: ca.SX | float = stopping_deceleration(most_b, velocity, position[1] - position[0], longest)
    if motor is not None:
        deceleration = ca.fmin(deceleration, ca.fmax(motor, WEAKEST))
    lower, upper = low, high
    if math.isfinite(position[1]):
        upper = (_velocity_at_end(position[1] - q, v, dt, deceleration, return_rate) - v) / dt
        upper = clip(upper, low, high) if bounded else upper
    if math.isfinite(position[0]):
        lower = (-_velocity_at_end(q - position[0], -v, dt, deceleration, return_rate) - v) / dt
        lower = clip(lower, low, high) if bounded else lower
        if math.isfinite(position[1]):
            lower = ca.fmin(lower, upper)
    return lower, upper


def _velocity_at_end(distance: ca.SX, v: ca.SX, dt: ca.SX, deceleration: ca.SX | float, return_rate: ca.SX) -> ca.SX:
    """w of the module towards a limit ``distance`` away; negative outside, the slowest return."""
    if isinstance(deceleration, float) and math.isinf(deceleration):
        stopped = 2.0 * distance / dt - v
        return stopped
    c = distance - 0.5 * v * dt
    speed = _fastest(ca.fmax(c, 0.0), dt, deceleration)
    turning = v - v * v * dt / (2.0 * ca.fmax(distance, LEAST))
    outside = ca.fmax(return_rate * distance, -_fastest(ca.fmax(-distance, 0.0), dt, deceleration))
    return ca.if_else(distance < 0.0, outside, ca.if_else(c < 0.0, turning, speed))


def _fastest(c: ca.SX, dt: ca.SX, deceleration: ca.SX | float) -> ca.SX:
    if isinstance(deceleration, float) and deceleration == 0.0:
        return 0.0 * c  # a joint whose limit of velocity is zero
    return 4.0 * c / (dt + ca.sqrt(dt * dt + (8.0 / deceleration) * c))
