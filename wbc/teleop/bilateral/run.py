"""Bilateral teleoperation tick by tick: ports with passivity control, an operator, a wall, and what is recorded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.teleop.bilateral.scheme import Bilateral, Channels, Device
from wbc.validation import Array


class Packet(NamedTuple):
    """What a side sends: where it is, how fast, its outer force, and the energy that it has taken in so far [J]."""

    x: Array
    v: Array
    force: Array
    energy: Array


class Port:
    """One side of one or of many teleoperators at once: arrays [runs, n] of n coordinates, numbers [runs, 1].

    A tick, for the outer force f and the channels' force f_c on the device:

        u+ = s w,   w = m u + dt (f + f_c),   s = 1 / (m + dt d) without passivity control.

    The work of the teleoperator on the device, with the damping beyond the reserve d_0 counted as its own, is

        E(s) = s (dt f_c.w - |w|^2) + s^2 |w|^2 (m + dt d_0)            [J],

    a parabola through 0. With passivity control s is the largest for which E(s) is at most what the other side has told
    of, less what this one has given out: more damping, and at most as much as stops it. So the sum of what both give
    out never exceeds what both take in, whatever is late, lost or out of order. What is counted is the work of the
    motion that the arm really made.

    Source: Ryu, Artigas and Preusche, Mechatronics 20 (2010), for the observers; the damping is solved for implicitly
    here, so that no tick gives out more than there is.
    """

    def __init__(
        self, devices: Sequence[Device], channels: Sequence[Channels], dt: float, passive: Sequence[bool], n: int
    ) -> None:
        def column(numbers: Sequence[float]) -> Array:
            return np.array(numbers, dtype=float)[:, None]

        self.dt, self.passive = dt, np.array(passive, dtype=bool)[:, None]
        self.mass, self.damping = column([d.mass for d in devices]), column([d.damping for d in devices])
        self.reserve = column([0.5 * d.stiffest * dt for d in devices])
        self.stiffness, self.rate = column([c.stiffness for c in channels]), column([c.damping for c in channels])
        self.remote, self.local = column([c.remote_force for c in channels]), column([c.local_force for c in channels])
        #: Position, velocity over the last period; energy taken in and given out; by how much the last tick was damped
        self.x, self.v = np.zeros((len(devices), n)), np.zeros((len(devices), n))
        self.taken, self.given = np.zeros((len(devices), 1)), np.zeros((len(devices), 1))
        self.scale = np.ones((len(devices), 1))

    def packet(self, force: Array) -> Packet:
        """What is sent in this tick."""
        return Packet(self.x, self.v, force, self.taken)

    def step(self, there: Packet, force: Array) -> Array:
        """Where to go in this period [runs, n], for the newest packet of the other side and the outer force."""
        pull = self.stiffness * (there.x - self.x) + self.rate * (there.v - self.v)
        pull += self.remote * there.force - self.local * force
        w = self.mass * self.v + self.dt * (force + pull)
        free = 1.0 / (self.mass + self.dt * self.damping)
        square = np.sum(w * w, axis=1, keepdims=True)
        linear = self.dt * np.sum(pull * w, axis=1, keepdims=True) - square
        quadratic = square * (self.mass + self.dt * self.reserve)
        budget = there.energy - self.given
        allowed = _largest(quadratic, linear, budget, free)
        s = np.where(self.passive, allowed, free)
        self.scale = s / free
        return np.asarray(self.x + self.dt * s * w)

    def moved(self, x: Array, force: Array) -> None:
        """Where the arm is after the period, and the outer force that it began with."""
        way = x - self.x
        v = way / self.dt
        net = self.mass * (v - self.v) / self.dt - force + self.reserve * v
        flow = -np.sum(net * way, axis=1, keepdims=True)
        self.taken = self.taken + np.maximum(flow, 0.0)
        self.given = self.given + np.maximum(-flow, 0.0)
        self.x, self.v = x, v

    @property
    def kinetic(self) -> Array:
        """Energy of the device's mass [runs] [J]."""
        return np.asarray(0.5 * self.mass[:, 0] * np.sum(self.v**2, axis=1))


def _largest(a: Array, b: Array, c: Array, most: Array) -> Array:
    """The largest s in [0, most] with a s^2 + b s <= c; where there is none, the s that comes nearest."""
    root = np.sqrt(np.maximum(b * b + 4.0 * a * c, 0.0))
    # Of both forms of the upper root the one without cancellation
    low = np.where(b > 0.0, b + root, 1.0)
    high = np.where(a > 0.0, 2.0 * a, 1.0)
    upper = np.where(b > 0.0, 2.0 * c / low, np.where(a > 0.0, (root - b) / high, most))
    return np.asarray(np.clip(upper, 0.0, most))


@dataclass(frozen=True, eq=False)
class Operator:
    """A hand that wants to be at ``path`` [ticks, n]: force = stiffness (path - x) - damping v."""

    path: Array
    stiffness: float = 400.0
    damping: float = 20.0


@dataclass(frozen=True)
class Wall:
    """An elastic wall before each coordinate from ``at`` on: force = -max(0, stiffness (x - at) + damping v) inside."""

    at: float = np.inf
    stiffness: float = 1000.0
    damping: float = 10.0


class Follower(Protocol):
    """What follows a device, see :class:`wbc.teleop.bilateral.arms.FollowingArm`."""

    n: int
    dt: float

    def move(self, x: Array) -> Array:
        """Go to displacements x [n] in one period; where it is then [n]."""


@dataclass(frozen=True, eq=False)
class BilateralRecord:
    """What happened, of each run: positions, velocities and outer forces [ticks, runs, n], energies [ticks, runs] [J].

    Attributes:
        taken, given: by the teleoperator from both devices, and to them. stored: kinetic energy of the devices, and
            elastic energy of hand and wall. injected: by the operator, who moves the end of the hand's spring.
        scale: of master and slave, 1 where passivity control does nothing [ticks, runs, 2].
        interrupted: ended by Ctrl-C; it has the ticks until then.
    """

    time: Array
    master: Array
    slave: Array
    master_v: Array
    slave_v: Array
    operator_force: Array
    wall_force: Array
    taken: Array
    given: Array
    stored: Array
    injected: Array
    scale: Array
    interrupted: bool = False

    def excess(self) -> Array:
        """Largest stored - injected over the run [runs] [J]: above 0 energy has come from nowhere."""
        return np.asarray((self.stored - self.injected).max(axis=0))


def run_bilateral(
    systems: Bilateral | Sequence[Bilateral], operators: Operator | Sequence[Operator], walls: Wall | Sequence[Wall],
    *, arms: tuple[Follower | None, Follower | None] = (None, None), seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> BilateralRecord:  # fmt: skip
    """Teleoperation from rest at 0 until the operators' paths end; many independent runs of the same period at once.

    Args:
        arms: robots that the master and the slave of a single run move; None: points that go where they are sent.
        seed: of the links' jitter and losses. progress: called after every tick with how many are done.

    Raises:
        ShapeError: not as many operators and walls as systems, paths of different shapes, systems of different periods,
            or arms that do not fit. RangeError: a hand or wall that is stiffer or more damped than a device stands.
    """
    many = [systems] if isinstance(systems, Bilateral) else list(validation.items("systems", systems))
    hands = [operators] if isinstance(operators, Operator) else list(validation.items("operators", operators))
    sides = [walls] if isinstance(walls, Wall) else list(validation.items("walls", walls))
    if not many or not len(many) == len(hands) == len(sides):
        raise ShapeError("systems", len(many), f"expected as many as operators, {len(hands)}, and walls, {len(sides)}")
    dt = many[0].dt
    paths = [validation.ordinary_array("operators.path", hand.path) for hand in hands]
    shape = paths[0].shape
    if len(shape) != 2 or any(path.shape != shape for path in paths) or any(one.dt != dt for one in many):
        raise ShapeError("operators.path", shape, "expected paths [ticks, n] of one shape and systems of one period")
    for arm in arms:
        if arm is not None and (len(many) != 1 or arm.n != shape[1] or arm.dt != dt):
            raise ShapeError("arms", arm, f"expected one run, and arms of {shape[1]} coordinates and {dt:g} s")
    validation.function("progress", progress)
    for system, hand, wall in zip(many, hands, sides, strict=True):
        _touched("operator", hand, system.master)
        _touched("wall", wall, system.slave)
    path = np.array(paths).transpose(1, 0, 2)
    hand_k, hand_b = (np.array([[getattr(h, name)] for h in hands]) for name in ("stiffness", "damping"))
    wall_k, wall_b, wall_at = (np.array([[getattr(w, name)] for w in sides]) for name in ("stiffness", "damping", "at"))
    ticks, n = shape
    passive = [one.passivity for one in many]
    master = Port([s.master for s in many], [s.scheme.master for s in many], dt, passive, n)
    slave = Port([s.slave for s in many], [s.scheme.slave for s in many], dt, passive, n)
    generator = np.random.default_rng(seed)
    forth = np.array([s.forward.newest(ticks, dt, generator) for s in many]).T
    back = np.array([s.backward.newest(ticks, dt, generator) for s in many]).T
    runs, every = len(many), np.arange(len(many))
    sent = [[np.zeros((ticks + 1, runs, m)) for m in (n, n, n, 1)] for _ in range(2)]
    energies, scale, injected = np.zeros((4, ticks, runs)), np.ones((ticks, runs, 2)), np.zeros(runs)

    def received(side: int, rows: Array) -> Packet:
        return Packet(*(column[rows, every] for column in sent[side]))

    def tick(k: int) -> None:
        nonlocal injected
        inside = slave.x - wall_at
        push = np.maximum(wall_k * inside + wall_b * slave.v, 0.0)
        forces = hand_k * (path[k] - master.x) - hand_b * master.v, np.where(inside > 0.0, -push, 0.0)
        for side, port in enumerate((master, slave)):
            for column, value in zip(sent[side], port.packet(forces[side]), strict=True):
                column[k + 1] = value
        elastic = 0.5 * hand_k[:, 0] * np.sum((path[k] - master.x) ** 2, axis=1)
        elastic += 0.5 * wall_k[:, 0] * np.sum(np.maximum(inside, 0.0) ** 2, axis=1)
        if k == 0:
            injected += elastic
        given, taken = (master.given + slave.given)[:, 0], (master.taken + slave.taken)[:, 0]
        energies[:, k] = taken, given, master.kinetic + slave.kinetic + elastic, injected
        scale[k] = np.hstack((master.scale, slave.scale))
        goals = master.step(received(1, back[k]), forces[0]), slave.step(received(0, forth[k]), forces[1])
        for port, arm, goal, force in zip((master, slave), arms, goals, forces, strict=True):
            port.moved(goal if arm is None else arm.move(goal[0])[None], force)
        if k + 1 < ticks:
            before, after = path[k] - master.x, path[k + 1] - master.x
            injected = injected + 0.5 * hand_k[:, 0] * np.sum(after**2 - before**2, axis=1)

    done, interrupted = 0, False
    try:
        for done in range(1, ticks + 1):
            tick(done - 1)
            if progress is not None:
                validation.called("progress", progress, done)
    except KeyboardInterrupt:
        done, interrupted = done - 1, True
    (xm, vm, fm), (xs, vs, fs) = ([column[1 : done + 1] for column in side[:3]] for side in sent)
    taken, given, stored, put_in = energies[:, :done]
    return BilateralRecord(
        np.arange(done) * dt, xm, xs, vm, vs, fm, fs, taken, given, stored, put_in, scale[:done], interrupted
    )


def _touched(name: str, by: Operator | Wall, device: Device) -> None:
    for own, most in (("stiffness", device.stiffest), ("damping", device.most_damped)):
        number = validation.scalar(f"{name}.{own}", getattr(by, own), low=0.0)
        if number > most:
            raise RangeError(f"{name}.{own}", number, f"expected at most {most:g}, for which the device is made")
