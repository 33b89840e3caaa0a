"""How fast a swinging hand's aim goes on, and when a hand may close."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, sqrt

import numpy as np

from wbc.robots import WalkerData
from wbc.validation import Array
from wbc.walking.loop.stack import AXIS_GAIN, SWING_GAIN
from wbc.walking.loop.state import Swinging

#: The place that a hand is pulled to is no farther from it than this [m]
BEHIND = 0.02
#: A swing waits for a hand that is behind its aim or beside it: full pace up to the first [m], least pace beyond the
#: second. As it comes to the distance at which it may be near to what its hold is mounted on, within :data:`OVER` of
#: it [m], it is over the hold; so is one that leaves a hold, from where it is to beyond that distance
BESIDE, WAITS, LEAST_PACE = 0.0008, 0.005, 0.05
OVER = (0.06, 0.16)
#: A hand is near its hold from this part of the wrist's motion on; its joints are then this near to theirs [rad]
LANDING, TURNED = 0.97, 0.5
#: Part of the tolerances within which a hand closes: it is still moving a little as it does
SURE = 0.7
#: A hand that leans is at rest where it turns by less than this part of what one may that is upright
TURNING = 0.5
#: A hand closes on a compliant hold when it leans by less than this part of what it may
CLOSING_TILT = 0.5
#: The pace of a hand changes from nothing to all in [s]; after a pause, which may be where its law is fastest, in
HAND_RAMP, RAMP_AGAIN = 0.2, 0.5
#: After an abort it goes to nothing in [s]: joints at their rates need 0.25 s
HAND_STOP = 0.3


def hand_pace(
    swinging: Swinging, place: Array, turned: bool, early: float, pace: float, far: tuple[float, float]
) -> float:
    """Part of full speed at which the aim of a hand should go on.

    Args:
        place: of the hand [m]. turned: its wrist is on the branch that it lands with.
        early: path time until the hold can be held [s]. pace: of the body.
        far: the hand is from where it began, and from its hold [m].
    """
    aim = swinging.aim
    # In plain floats: three numbers are too few for numpy to be quick
    (a, b, c), (x, y, z), (u, v, w) = aim.position.tolist(), place.tolist(), aim.velocity.tolist()
    x, y, z, speed = a - x, b - y, c - z, sqrt(u * u + v * v + w * w)
    along = (x * u + y * v + z * w) / speed if speed > 1e-6 else 0.0
    across = sqrt(max(x * x + y * y + z * z - along * along, 0.0))
    # A hand that is ahead must not be stopped: it could not
    off = max(along, 0.0) + across
    least, most = (BESIDE, WAITS) if far[0] < OVER[1] or OVER[0] < far[1] < OVER[1] else (0.5 * BEHIND, 1.5 * BEHIND)
    wanted = min(max((most - off) / (most - least), LEAST_PACE), 1.0)
    wait = early - pace * (swinging.law.duration - swinging.clock) / swinging.most
    if wait > 0.0:
        wanted /= 1.0 + 4.0 * wait
    return 0.0 if aim.blend > LANDING and not turned else wanted


def ramp_of(swinging: Swinging) -> float:
    """Time in which its pace changes from nothing to all [s]."""
    return RAMP_AGAIN if swinging.paused else HAND_RAMP


def at_rest(
    before: tuple[Array, Array, Array],
    hand: tuple[Array, Array, Array],
    hold: tuple[Array, Array],
    x: Array | None,
    tilt: float,
    data: WalkerData,
    dt: float,
    earlier: Array | None = None,
) -> bool:
    """Whether a hand is on its hold and still, so that it may close.

    Args:
        before, hand: its place [m], z axis and x axis a tick ago and now. hold: place and z axis.
        x: the x axis that it is to have, None if it may roll. tilt: ``max_tilt`` of the hold [rad].
        earlier: z axis two ticks ago; None: not known, or measured too coarsely to say how the hand turns on.
    """
    (place, axis, x_axis), (there, wanted) = hand, hold
    # A hand at the turning point of an overshoot is slow, but what is left brings it up to speed again
    near, slow = SURE * data.close_distance, SURE * data.close_speed
    if dist(place, there) >= min(near, slow / SWING_GAIN) or dist(place, before[0]) / dt >= slow:
        return False
    turn = angle(axis, before[1])
    if x is not None:
        turn = hypot(turn, angle(x_axis, before[2]))
        if abs(np.arctan2(x_axis @ np.cross(wanted, x), x_axis @ x)) >= SURE * data.close_angle:
            return False
    leans, leaned, rate = angle(axis, wanted), max(SURE * data.close_angle, CLOSING_TILT * tilt), SURE * data.close_rate
    if earlier is not None and AXIS_GAIN * leans >= rate:
        # Nor is one at rest that leans and turns back: in the next tick it is as much faster, or more
        ahead = 2.0 * np.cross(before[1], axis) - np.cross(earlier, before[1])
        turn, rate = max(turn, float(np.linalg.norm(ahead))), TURNING * rate
    return turn / dt < rate and leans < leaned


def turned(swinging: Swinging, wrist: Sequence[float]) -> bool:
    """Whether joints 4 and 5, and 6 where the roll counts, are near to where they are to be [rad]."""
    (a, b, c), (d, e, f) = wrist, swinging.wrist
    return abs(a - d) < TURNED and abs(b - e) < TURNED and (swinging.x is None or abs(c - f) < TURNED)


def angle(one: Array, other: Array) -> float:
    """Between two unit vectors [rad]; exact for small angles."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
