"""The command of a swinging hand: along its law, and turned upright where it comes down."""

from __future__ import annotations

import functools
from math import cos, inf, sin, sqrt

import casadi as ca
import numpy as np

from wbc.multibody import pin
from wbc.native.compiled_function import compiled
from wbc.robots import WalkerData
from wbc.symbolic.evaluation import SingleState
from wbc.validation import Array
from wbc.walking.loop.hand_pace import BEHIND, angle
from wbc.walking.loop.state import Axes, Swinging
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.swings.law import Aim

#: Where things are in the output: what is `now` in the next tick, joints 4 to 6 with the part of the wrist's path, the
#: velocity, and what the stack follows
NOW, WRIST, VELOCITY, FOLLOWED = slice(0, 6), slice(3, 7), slice(7, 10), slice(10, 22)

#: Part of joint 3's acceleration with which a hand brakes; what the elbow is off the line from shoulder to wrist at
#: least [m]
BRAKING, LEAST_BEND = 0.5, 0.02
#: Keeps 0 / 0 away; a hand that can brake as it wants [m]
TINY, MOST = 1e-300, 1e3


def braking(data: WalkerData, elbow: float, gain: float) -> float:
    """b of an arm: at a distance d from its aim a hand that follows with a gain k and brakes with a comes to rest there
    if k min(d, sqrt(b d)) <= sqrt(2 a d), so

        b = 2 a / k^2,     a = BRAKING h a_3,     h = L1 L2 |sin theta3| / |L1 + L2 exp(i theta3)|

    h, by which the elbow is off the line from shoulder to wrist, is the lever of joint 3 along that line. Where the
    elbow is nearly straight a hand that followed with all of the gain would swing about its aim.

    Args:
        data: of the arm. elbow: theta3 [rad]. gain: k [1/s].

    Returns:
        b [m].
    """
    first, second = data.upper_arm_length, data.forearm_length
    reach = sqrt(max(first * first + second * second + 2.0 * first * second * cos(elbow), TINY))
    lever = max(first * second * abs(sin(elbow)) / reach, LEAST_BEND)
    return 2.0 * BRAKING * lever * data.joint_accelerations[2] / (gain * gain)


@functools.cache
def aim_function() -> ca.Function:
    """f(place, now, law, source, target, parts, rate, brakes) of a hand at ``place`` ``[3]``.

    Args:
        now: its aim and joints 4 to 6 as the tick begins ``[6]``. law: two rows of its law ``[14]``.
        source, target: joints 4 to 6 of the grips that it leaves and comes to, at two samples of the body's path
            ``[6]``. parts: of the segments between those rows and samples ``[3]``. rate: 1 / dt [1/s].
        brakes: b, see :func:`braking` [m].

    Returns:
        The position of the law, joints 4 to 6 as the tick ends, the part of the wrist's path, the velocity; and place,
        velocity, joints and their rates to follow, from where things are to be as the tick begins to where they are to
        be as it ends. A hand that cannot follow must not drag the body: its place waits within :data:`BEHIND` of it,
        and at a distance d within sqrt(b d), so that it can brake.
    """
    sizes = {"place": 3, "now": 6, "law": 14, "source": 6, "target": 6, "parts": 3, "rate": 1, "brakes": 1}
    place, now, law, source, target, parts, rate, brakes = (ca.SX.sym(name, size) for name, size in sizes.items())
    row, first, last = (
        rows[: rows.numel() // 2] + parts[k] * (rows[rows.numel() // 2 :] - rows[: rows.numel() // 2])
        for k, rows in enumerate((law, source, target))
    )
    wrist = first + row[6] * (last - first)
    gap = now[:3] - place
    far = ca.norm_2(gap)
    most = ca.fmin(BEHIND, ca.sqrt(brakes * far))
    waits = place + gap * (most / ca.fmax(far, most + TINY))
    followed = ca.vertcat(ca.if_else(far <= most, now[:3], waits), (row[:3] - now[:3]) * rate)
    out = ca.vertcat(row[:3], wrist, row[6], row[3:6], followed, now[3:], (wrist - now[3:]) * rate)
    return compiled(ca.Function("aim", [place, now, law, source, target, parts, rate, brakes], [out]))


class HandCommand:
    """What the swinging hand follows in a tick.

    Args:
        dt: control period [s].
    """

    def __init__(self, dt: float) -> None:
        self._step = SingleState(aim_function())
        self._place, self._now, self._law, self._source, self._target, self._parts, rate, self._brakes = (
            self._step.inputs
        )
        rate[0] = 1.0 / dt
        # What the inputs are of, so that they are written when they change
        self._swinging: Swinging | None = None
        self._known: list[tuple[Grips | None, int, int]] = [(None, -1, -1)] * 2

    def go(
        self, swinging: Swinging, place: Array, grips: Grips, source: int, sample: float, brakes: float = inf
    ) -> Array:
        """Move the hand's aim and its wrist on to its clock.

        Args:
            place: of the hand [m]. source: the grip that it leaves. sample: of the body's path.
            brakes: see :func:`braking` [m].

        Returns:
            Place [m], velocity [m/s], joints 4 to 6 [rad] and their rates [rad/s] to follow ``[12]``.
        """
        parts = self._parts
        if swinging is self._swinging:
            self._now[:] = self._step.output[NOW]
        else:
            self._now[:], self._swinging = (*swinging.aim.position, *swinging.wrist), swinging
        self._place[:], self._brakes[0] = place, min(brakes, MOST)
        self._law[:], parts[0], whole = swinging.law.rows_at(swinging.clock)
        if swinging.first_wrist is None:
            parts[1] = self._between(0, grips, source, sample)
        else:
            self._source[:3] = self._source[3:] = swinging.first_wrist
            self._known[0] = None, -1, -1
        parts[2] = self._between(1, grips, swinging.grip, sample)
        self._step.run()
        out = self._step.output.copy()
        a, b, c, blend = out[WRIST].tolist()
        swinging.aim, swinging.wrist = Aim(out[:3], out[VELOCITY], blend, whole), (a, b, c)
        return out[FOLLOWED]

    def _between(self, which: int, grips: Grips, grip: int, sample: float) -> float:
        """Write joints 4 to 6 of a grip at two samples; the part of the segment between them."""
        first, last, rows = grips.wrists(grip)
        inside = min(max(sample, first), last) - first
        low = min(int(inside), last - first - 1)
        of, key, known = (self._source, self._target)[which], (grips, grip, low), self._known[which]
        if key != known:
            of[:] = rows[low : low + 2].reshape(6)
            self._known[which] = key
        return inside - low


#: A wrist that turns the hand's axis less well than this, of 1, is not to turn it at the cost of the hand's place
BENT = 0.6


def axis_part(bend: float) -> float:
    """Part of the weight with which the axis of a hand that comes down counts against its place, (bend / BENT)^2.

    Joint 4 turns the axis by |sin theta5| times its own turn. Where that is little it needs a while for it at its rate
    and acceleration; with all of the weight the other joints would help, and take the hand off its way by centimetres.

    Args:
        bend: how well the wrist turns the hand's axis, see :meth:`wbc.robots.Limb.wrist_bend`.
    """
    return min(bend / BENT, 1.0) ** 2


#: A hand turns upright when its aim is within this of its hold [m]; until then its wrist follows its law
UPRIGHT = 0.05
#: A hand whose law ends within this of its hold turns at once [m]
THERE = 0.001
#: |mu| is at most so many times |phi|, or this angle where |phi| is less [rad]
GOES_ON, LEAST_TURN = 3.0, 0.05


class HandLanding:
    """The axes of a hand that comes down, in the structure's frame:

        z(r) = exp(w(r)) z_hold,     x(r) = exp(w(r)) x_hold,     r = |p - p_hold| / |p_0 - p_hold|
        w(r) = (r + r^2 - r^3) phi + (r^3 - r^2) mu,     w(1) = phi,     w'(1) = mu

    p is its aim, p_0 that at which its wrist was let go, phi the turn that takes the axes of the hold to those which
    the hand had there; the shortest one where only z counts. mu is such that the hand goes on to turn as it turned
    then, so that no wrist changes its rates from one tick to the next; mu = phi on joints that lag, whose hands are
    farther by then than they are seen. As the arm brings a hand down along the normal its lean
    goes with its height. To want the hold's own axis at once turns the hand by that lean in a tenth of a second, and
    with theta5 near 0, where joint 4 hardly turns it, off its path by centimetres.

    Args:
        dt: control period [s].
    """

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._swinging: Swinging | None = None
        self._phi, self._mu, self._far, self._part = np.zeros(3), np.zeros(3), 0.0, 0.0
        # Axes of the hand a tick ago
        self._before: tuple[Swinging, Array, Array] | None = None

    def go(self, swinging: Swinging, hold: tuple[Array, Array], near: bool, lag: float = 0.0) -> Axes | None:
        """The axes as a tick begins and their rates in it, once the aim of the hand has been moved on; None until then.

        Args:
            swinging: ``axis`` and ``x_axis`` are those of the hand now. hold: its place [m] and z axis.
            near: it comes down on it. lag: of the joints [s].
        """
        if not near:
            self._swinging, self._before = None, (swinging, swinging.axis, swinging.x_axis)
            return None
        place, z = hold
        far, x = float(np.linalg.norm(swinging.aim.position - place)), swinging.x
        if swinging is not self._swinging:
            self._swinging, self._phi, self._far = swinging, _turn(swinging.axis, swinging.x_axis, z, x), far
            self._mu = self._goes_on(swinging, place) if lag == 0.0 else self._phi
            self._part = 1.0 if far > THERE else 0.0
        before, self._part = self._part, min(self._part, far / self._far if self._far > THERE else 0.0)
        now, later = (pin.exp3(self._lean(part)) for part in (before, self._part))
        rate = (later - now) / self._dt
        return Axes(now @ z, rate @ z, None if x is None else now @ x, None if x is None else rate @ x)

    def _lean(self, r: float) -> Array:
        """w(r)."""
        return np.asarray(r * (1.0 + r - r * r) * self._phi + r * r * (r - 1.0) * self._mu)

    def _goes_on(self, swinging: Swinging, place: Array) -> Array:
        """mu: the rate at which the hand turned until now, for its way to the hold; less where that is much."""
        closing = swinging.pace * float(swinging.aim.velocity @ (place - swinging.aim.position)) / self._far
        if self._before is None or self._before[0] is not swinging or closing < THERE:
            return self._phi
        _, axis, x_axis = self._before
        rate = _turn(swinging.axis, swinging.x_axis, axis, None if swinging.x is None else x_axis) / self._dt
        mu, most = -rate * self._far / closing, GOES_ON * max(float(np.linalg.norm(self._phi)), LEAST_TURN)
        return np.asarray(mu * min(1.0, most / max(float(np.linalg.norm(mu)), 1e-12)))


def _turn(axis: Array, x_axis: Array, z: Array, x: Array | None) -> Array:
    """Rotation vector that takes z, and x where there is one, to the axes of a hand [rad]."""
    if x is not None:
        hand, hold = (np.column_stack([a, np.cross(b, a), b]) for a, b in ((x_axis, axis), (x, z)))
        return np.asarray(pin.log3(hand @ hold.T))
    across = np.cross(z, axis)
    return np.asarray(across * (angle(z, axis) / max(float(np.linalg.norm(across)), 1e-12)))
