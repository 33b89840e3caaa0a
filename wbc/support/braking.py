"""Accelerations at which joints can brake, where the mass matrix, the torque limits and the contacts decide.

``JointLimits`` counts on decelerations up to ``robot.limits.acceleration`` in every state. The motors of an arm on a
fixed base have them in a state (q, v) for all directions in which joints may move if

    |h(q, v)|_k + s sum_j |M_kj(q)| A_j <= share T_k      for every joint k,

A the accelerations that are asked for, s their scale. With contacts, on a base that floats or not, they are there if
accelerations and wrenches (a, w) have them by the rows of the tick itself (docs/torque.md):

    maximise s <= 1    subject to    the rows of base, contacts and wrenches,    -share T <= tau <= share T,
                                     -A <= a <= A,    -sign(v_j) a_j >= s A_j    for every j that brakes.

All joints brake at once that contacts leave free; of those that contacts couple, such as two legs that stand, the one
that is fastest for its limit, and the others are free to make way. The least s of many random states is found: it is
sampled, not proven. Where none of n independent states allows less, with a confidence of 95 % less than a share 3 / n
of all such states does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from scipy.linalg import null_space, orth
from scipy.sparse.csgraph import connected_components

from wbc import validation
from wbc.controller.compiled_stack import CompiledStack
from wbc.errors import CommandError, RangeError
from wbc.linear_program import least
from wbc.multibody import mass_matrix, pin
from wbc.robot import Robot
from wbc.support.statics import Statics, TorqueRows, least_lack
from wbc.validation import Array

#: Rates that contacts leave below this share of their limits are none
STILL = 1e-6
#: Corrections by which contacts come back to where they are
CORRECTIONS = 12
#: Error of a contact that is left after them [m, rad]
CLOSED_TO = 1e-9
#: Random configurations that are given up for one that contacts and limits allow
TRIES = 50


@dataclass(frozen=True, eq=False)
class Braking:
    """What :func:`braking` found.

    Attributes:
        acceleration: at which joints can brake, in all states that were tried [nv, rad/s^2, m/s^2]; infinite for a base
            that floats.
        scale: s, by which the accelerations that were asked for are less, at most 1. decides: the joint whose motor, or
            ``item/row`` whose limit, decides.
        q, v: the state in which it does. samples: how many states were tried.
    """

    acceleration: Array
    scale: float
    decides: str
    q: Array
    v: Array
    samples: int


def braking(
    robot: Robot | CompiledStack,
    q: Any = None,
    *,
    share: float = 0.95,
    speed: float = 1.0,
    spread: float = 0.1,
    samples: int = 2000,
    seed: int = 0,
) -> Braking:
    """Accelerations for ``robot.with_limits(acceleration=...)`` that motors and contacts have wherever the robot is.

        robot = robot.with_limits(acceleration=wbc.support.braking(robot).acceleration)             # a fixed arm
        robot = robot.with_limits(acceleration=wbc.support.braking(controller, q).acceleration)     # with contacts

    Args:
        robot: on a fixed base, with finite limits of acceleration and torque; or a controller that commands torques,
            whose contacts are where they are at ``q``, with their friction, ratings, loads and switches as they are.
        q: of a controller: the configuration about which its contacts stay [nq].
        share: part of the torques that braking may take.
        speed: part of the velocity limits up to which joints move.
        spread: of a controller: joints that contacts couple are up to about so far from ``q`` [rad, m]; the others are
            anywhere within their limits.
        samples: random states; a third of them at full speed, a third at rest. seed: of the random states.

    Raises:
        CommandError: a robot whose base floats without the controller that has its contacts; a controller that does
            not command torques, or without q.
        RangeError: a limit that is not finite, a configuration whose contacts and limits leave no others about it, or
            motors and contacts that cannot hold the robot in one of the states, with what is missing.
        ShapeError, NotFiniteError: q. SolverError: values of inputs that nobody has set. UnsupportedJointError: loops.
    """
    count, rate = validation.integer("samples", samples, low=1), validation.scalar("speed", speed, low=0.0, high=1.0)
    part = validation.scalar("share", share, low=0.0, high=1.0, open_low=True)
    random = np.random.default_rng(validation.integer("seed", seed))
    (robot.stack.robot if isinstance(robot, CompiledStack) else robot).require_tree("what motors can brake")
    if isinstance(robot, CompiledStack):
        far = validation.scalar("spread", spread, low=0.0)
        return _WithContacts(robot, q, part, rate, far).search(random, count)
    if robot.base != "fixed":
        reason = "what joints on a base that moves can brake is up to its contacts: give the controller that has them"
        raise CommandError("robot", robot.name, reason)
    _check_finite(robot)
    limits, model = robot.limits, robot.model
    data, least, found = model.createData(), 1.0, (robot.dof_names[0], robot.neutral, np.zeros(robot.nv))
    low, high = _ranges(robot)
    for k in range(count):
        configuration = pin.neutral(model)
        for i, place in enumerate(robot.position_index):
            if place >= 0:
                configuration[place] = random.uniform(low[i], high[i])
        v = rate * limits.velocity * _pace(random, robot.nv, k)
        M = mass_matrix(model, data, configuration)
        left = part * limits.effort - np.abs(pin.nonLinearEffects(model, data, configuration, v))
        motor = int(np.argmin(left / (np.abs(M) @ limits.acceleration)))
        if left[motor] <= 0.0:
            at = np.round(configuration, 3).tolist()
            reason = f"{robot.dof_names[motor]!r} lacks {-left[motor]:.3g} to carry the robot at {at}"
            raise RangeError("robot.limits.effort", float(limits.effort[motor]), reason)
        scale = float(left[motor] / (np.abs(M[motor]) @ limits.acceleration))
        if scale < least:
            least, found = scale, (robot.dof_names[motor], configuration, v)
    return Braking(least * limits.acceleration, least, *found, count)


def _check_finite(robot: Robot) -> None:
    for name in ("acceleration", "effort", "velocity"):
        values = getattr(robot.limits, name)[robot.base_nv :]
        if not np.isfinite(values).all():
            joint = robot.dof_names[robot.base_nv + int(np.argmin(np.isfinite(values)))]
            raise RangeError(f"robot.limits.{name}", np.inf, f"expected a finite limit of {joint!r}")


def _ranges(robot: Robot) -> tuple[Array, Array]:
    """Where joints may be, half a turn about 0 where they have no limits."""
    limits = robot.limits
    low, high = ((limits.position_lower, -np.pi), (limits.position_upper, np.pi))
    return np.where(np.isfinite(low[0]), *low), np.where(np.isfinite(high[0]), *high)


def _pace(random: np.random.Generator, count: int, k: int) -> Array:
    """Shares of the velocity limits: full, at rest, or anything between."""
    if k % 3 == 1:
        return np.zeros(count)
    return random.uniform(-1, 1, count) if k % 3 else random.choice([-1.0, 1.0], count)


class _WithContacts:
    """The linear programs of one controller: variables (a, w) in units of their sizes, then s."""

    def __init__(self, controller: CompiledStack, q: Any, share: float, speed: float, spread: float) -> None:
        if q is None:
            raise CommandError("q", q, "give the configuration about which the contacts stay")
        self._rows = TorqueRows(controller)
        self._robot = robot = self._rows.stack.robot
        _check_finite(robot)
        self._share, self._speed, self._spread = share, speed, spread
        self._q, self._base = robot.configuration("q", q), robot.base_nv
        self._low, self._high = _ranges(robot)
        space = self._space(self._motions(self._q)[0])
        # a joint is free that may move alone, with the base where that floats; what is left falls into groups
        tied = np.abs(space - np.eye(len(space))) > STILL
        count, group = connected_components(np.abs(space) > STILL, directed=False)
        joints = np.arange(self._base, robot.nv)
        self._free = joints[~tied.any(axis=1)]
        self._groups = [joints[(group == g) & tied.any(axis=1)] for g in range(count)]
        self._groups = [g for g in self._groups if len(g)]
        self._moved = np.concatenate([np.arange(self._base), *self._groups]).astype(np.intp)

    def search(self, random: np.random.Generator, count: int) -> Braking:
        """The least scale of some states."""
        robot, least = self._robot, 1.0
        found = (robot.dof_names[self._base], self._q, np.zeros(robot.nv))
        for k in range(count):
            q = self._configuration(random)
            v, signs = self._velocity(q, random, k)
            scale, decides = self._scale(q, v, signs)
            if scale < least:
                least, found = scale, (decides, q, v)
        acceleration = np.full(robot.nv, np.inf)
        acceleration[self._base :] = least * robot.limits.acceleration[self._base :]
        return Braking(acceleration, least, *found, count)

    def _motions(self, q: Array) -> tuple[Array, Array]:
        """J of what is held, and the displacement in its rows that closes it again."""
        A, lower, _ = self._rows.at(q, np.zeros(self._robot.nv))
        held, rate = self._rows.held, self._rows.returning
        on = np.isfinite(lower[held])
        step = np.divide(lower[held], rate, out=np.zeros(len(held)), where=(rate > 0.0) & on)
        return A[held][on][:, : self._robot.nv], step[on]

    def _space(self, J: Array) -> Array:
        """Projection of rates of joints to those that some motion of the base goes with."""
        whole = null_space(J) if len(J) else np.eye(self._robot.nv)
        basis = orth(whole[self._base :])
        return np.array(basis @ basis.T)

    def _configuration(self, random: np.random.Generator) -> Array:
        robot, model = self._robot, self._robot.model
        places, limits = robot.position_index, robot.limits
        for _ in range(TRIES):
            q = self._q.copy()
            for i in self._free[places[self._free] >= 0]:
                q[places[i]] = random.uniform(self._low[i], self._high[i])
            start = np.zeros(robot.nv)
            for group in self._groups:
                start[group] = random.uniform(-self._spread, self._spread, len(group))
            q = pin.integrate(model, q, start)
            for _ in range(CORRECTIONS):
                J, step = self._motions(q)
                if np.abs(step).max(initial=0.0) < CLOSED_TO:
                    inside = places >= 0
                    at = q[places[inside]]
                    if ((at >= limits.position_lower[inside]) & (at <= limits.position_upper[inside])).all():
                        return np.array(q)
                    break
                move = np.zeros(robot.nv)
                move[self._moved] = np.linalg.lstsq(J[:, self._moved], step, rcond=1e-8)[0]
                q = pin.integrate(model, q, move)
        raise RangeError("spread", self._spread, "contacts and limits leave no configuration so far about q")

    def _velocity(self, q: Array, random: np.random.Generator, k: int) -> tuple[Array, Array]:
        """A velocity that contacts allow, and which way each braking joint accelerates, 0 for the others."""
        robot, base = self._robot, self._base
        J, _ = self._motions(q)
        most, space = robot.limits.velocity, self._space(J)
        way = np.zeros(robot.nv)
        way[base:] = most[base:] * _pace(random, robot.nv - base, 0)
        fast = way[self._free] * np.abs(_pace(random, len(self._free), k))
        way[base:] = space @ way[base:]
        v, signs = np.zeros(robot.nv), np.zeros(robot.nv)
        v[self._free], signs[self._free] = self._speed * fast, -np.sign(way[self._free])
        for group in self._groups:
            shares = np.abs(way[group]) / most[group]
            if shares.max() < STILL:
                continue
            joint = group[int(np.argmax(shares))]
            v[group] = self._speed * abs(float(_pace(random, 1, k)[0])) * way[group] / shares.max()
            signs[joint] = -np.sign(way[joint])
        if base:
            v[:base] = -np.linalg.lstsq(J[:, :base], J[:, base:] @ v[base:], rcond=1e-10)[0]
        return v, signs

    def _state(self, q: Array, v: Array) -> Statics:
        """The rows of a state, in accelerations and wrenches."""
        rows = self._rows
        A, lower, upper = rows.at(q, v)
        held = rows.held[np.isfinite(lower[rows.held])]
        at, more = np.concatenate([rows.place, held]), np.ones(len(held))
        width = 0.5 * (1.0 - self._share) * (upper - lower)[rows.place]
        room = np.concatenate([np.where(rows.torques & np.isfinite(width), width, 0.0), 0.0 * more])
        return Statics(
            A[at],
            lower[at] + room,
            upper[at] - room,
            np.concatenate([rows.sizes, more]),
            np.concatenate([rows.base, more > 0.0]),
            np.concatenate([rows.torques, more < 0.0]),
            (*rows.names, *(("contacts", "motion", "m/s^2, rad/s^2"),) * len(held)),
            rows.scale[: A.shape[1]],
        )

    def _scale(self, q: Array, v: Array, signs: Array) -> tuple[float, str]:
        """The largest s of a state and what decides it."""
        found, limit, count = self._state(q, v), self._robot.limits.acceleration, self._robot.nv
        wide = found.A * found.scale / found.sizes[:, None]
        low, high = found.lower / found.sizes, found.upper / found.sizes
        equal, brakes = low == high, np.flatnonzero(signs)
        # -sign a_j / A_j + s <= 0, the acceleration in its unit
        matrices, ends, places = [np.zeros((len(brakes), wide.shape[1]))], [np.zeros(len(brakes))], []
        matrices[0][np.arange(len(brakes)), brakes] = -(signs * found.scale[:count] / limit)[brakes]
        for sign, end in ((1.0, high), (-1.0, low)):
            on = ~equal & np.isfinite(end)
            matrices.append(sign * wide[on])
            ends.append(sign * end[on])
            places += list(np.flatnonzero(on))
        above = np.vstack(matrices)
        last = (np.arange(len(above)) < len(brakes)).astype(float)
        cost = np.zeros(wide.shape[1] + 1)
        cost[-1] = -1.0
        most = np.full(wide.shape[1], np.inf)
        most[self._base : count] = (limit / found.scale[:count])[self._base :]
        answer = least(
            cost,
            np.column_stack([above, last]),
            np.concatenate(ends),
            np.column_stack([wide[equal], np.zeros(equal.sum())]),
            low[equal],
            np.column_stack([np.append(-most, -np.inf), np.append(most, 1.0)]),
        )
        if answer.x is None or answer.x[-1] <= 0.0:
            self._refuse(found, q, v, signs)
        prices = -answer.ineqlin.marginals[len(brakes) :]
        item, row, _ = found.names[places[int(np.argmax(prices))]] if places else ("robot.limits", "acceleration", "")
        return float(answer.x[-1]), f"{item}/{row}"

    def _refuse(self, found: Statics, q: Array, v: Array, signs: Array) -> NoReturn:
        """Name what is missing to hold the robot, with no joint that brakes going faster."""
        robot, base = self._robot, self._base
        limit, joints = robot.limits.acceleration[base:], np.eye(robot.nv, found.A.shape[1])[base:]
        least = np.where(signs[base:] > 0.0, 0.0, -limit)
        most = np.where(signs[base:] < 0.0, 0.0, limit)
        names = [("robot.limits.acceleration", name, "rad/s^2, m/s^2") for name in robot.dof_names[base:]]
        whole = Statics(
            np.vstack([found.A, joints]),
            np.concatenate([found.lower, least]),
            np.concatenate([found.upper, most]),
            np.concatenate([found.sizes, limit]),
            np.concatenate([found.base, np.ones(len(joints), bool)]),
            np.concatenate([found.torques, np.zeros(len(joints), bool)]),
            (*found.names, *names),
            found.scale,
        )
        short = least_lack(whole, q)
        what = ", ".join(str(one) for one in short[:3]) or "nothing but rounding"
        still = "at rest" if not v.any() else f"at {self._speed:g} of their velocity limits; a lower speed takes less"
        raise RangeError("speed", self._speed, f"motors and contacts lack {what} in a random state, joints {still}")
