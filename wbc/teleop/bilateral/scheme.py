"""What a bilateral teleoperator consists of: two devices, the channels between them, and the links that carry them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array

#: Delays and jitters beyond this are no link [s]
LONGEST = 10.0
#: Frequencies at which stability is judged at first
POINTS = 4096
#: Frequencies at which it is judged, at most
MOST = 2**20
#: What rounding may take from the criterion
ROUNDING = 1e-9


class Side(NamedTuple):
    """One device with its channels: mass over dt, damping beyond the reserve, stiffness times dt, and the others."""

    mass: float
    damping: float
    stiffness: float
    rate: float
    remote: float
    local: float


def absolute_stability(master: Side, slave: Side, forward: int, backward: int, dt: float) -> str:
    """What breaks stability with any passive operator and environment; empty if nothing does.

    With w = 1/z and velocities u over a period, (Z + C) u = (1 - local) f + C w^n u_r + remote w^n f_r where
    Z = m (1 - w) / dt + d and C = K dt w / (1 - w) + B w. Of the admittances Y that follow, at all |w| = 1

        Re Y11 >= 0,   Re Y22 >= 0,   2 Re Y11 Re Y22 - Re(Y12 Y21) - |Y12 Y21| >= 0,

    and the denominator (1 - w)^2 det has no zero in |w| < 1 (winding number).

    Args:
        forward, backward: delay [ticks].
    """
    points = POINTS
    while True:
        # Also frequencies far below the even grid's first
        even = (np.arange(points) + 0.5) * np.pi / points
        angles = np.concatenate((np.geomspace(1e-3, 1.0, 400, endpoint=False) * even[0], even))
        w = np.exp(-1j * angles)
        denominator, Y = _admittances(master, slave, forward, backward, w)
        steps = np.angle(denominator[1:] / denominator[:-1])
        if np.abs(steps).max() < 0.5 or points >= MOST:
            break
        points *= 4
    # It is real at both ends of the half circle, and clockwise each zero inside turns it back once on the whole
    first, last = np.angle(denominator[[0, -1]] * np.sign(denominator[[0, -1]].real))
    turns = -round(float(first + steps.sum() - last) / np.pi)
    if turns != 0:
        return f"the teleoperator is unstable by itself, with {turns} poles outside the unit circle"
    product = Y[0][1] * Y[1][0]
    size = 2.0 * np.abs(Y[0][0].real * Y[1][1].real) + 2.0 * np.abs(product)
    excess = 2.0 * Y[0][0].real * Y[1][1].real - product.real - np.abs(product)
    told = (
        ("Re Y11 >= 0", Y[0][0].real / np.abs(Y[0][0])),
        ("Re Y22 >= 0", Y[1][1].real / np.abs(Y[1][1])),
        ("2 Re Y11 Re Y22 >= Re(Y12 Y21) + |Y12 Y21|", excess / np.where(size > 0.0, size, 1.0)),
    )
    for name, margin in told:
        worst = int(np.argmin(margin))
        if margin[worst] < -ROUNDING:
            hertz = angles[worst] / (2.0 * np.pi * dt)
            return f"Llewellyn's bound {name} is broken at {hertz:.3g} Hz, by {-margin[worst]:.2g} of its terms"
    return ""


def _admittances(
    master: Side, slave: Side, forward: int, backward: int, w: Array
) -> tuple[Array, tuple[tuple[Array, Array], tuple[Array, Array]]]:
    """The denominator without its zero at 1, and Y, at points of the circle."""
    v = 1.0 - w
    there, back = w**forward, w**backward
    (Zm, Cm), (Zs, Cs) = (
        ((s.mass * v + s.damping) * v, s.stiffness * w + s.rate * w * v) for s in (master, slave)
    )  # both times 1 - w
    det = (Zm + Cm) * (Zs + Cs) - Cm * Cs * there * back
    a, b = 1.0 - master.local, 1.0 - slave.local
    top = (
        ((Zs + Cs) * a + Cm * back * slave.remote * there, (Zs + Cs) * master.remote * back + Cm * back * b),
        (Cs * there * a + (Zm + Cm) * slave.remote * there, Cs * there * master.remote * back + (Zm + Cm) * b),
    )
    rows = tuple((one * v / det, other * v / det) for one, other in top)
    return det / v, (rows[0], rows[1])


@dataclass(frozen=True)
class Device:
    """What an arm feels like: m du/dt + d u = outer force + force of the teleoperator, in each coordinate.

    Attributes:
        mass: m [kg, kg m^2]. damping: d [N s/m, N m s].
        stiffest, most_damped: of what may touch it, an operator's hand or a wall. Forces that are sampled give energy
            away: dt stiffest / 2 of the damping is for that (Colgate and Schenkel, 1997), and mass for the other.
    """

    mass: float = 2.0
    damping: float = 10.0
    stiffest: float = 2000.0
    most_damped: float = 50.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "damping", "stiffest", "most_damped", low=0.0)
        validation.own_scalars(self, "mass", low=0.0, open_low=True, unit="kg")

    def check(self, side: str, dt: float) -> None:
        """Raises:
        RangeError: a bound on the damping or the mass that sampling needs is broken, and which.
        """
        reserve, least = 0.5 * self.stiffest * dt, self.most_damped * dt
        if self.damping < reserve:
            raise RangeError(f"{side}.damping", self.damping, f"expected at least stiffest * dt / 2 = {reserve:g}")
        if self.mass < least:
            raise RangeError(f"{side}.mass", self.mass, f"expected at least most_damped * dt = {least:g}")


@dataclass(frozen=True)
class Channels:
    """Force on one device by what comes from the other (index r), late, and by its own outer force f:

    f_c = stiffness (x_r - x) + damping (v_r - v) + remote_force f_r - local_force f
    """

    stiffness: float = 0.0
    damping: float = 0.0
    remote_force: float = 0.0
    local_force: float = 0.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "stiffness", "damping", "remote_force", low=0.0)
        validation.own_scalars(self, "local_force", low=0.0, high=1.0)


@dataclass(frozen=True)
class Scheme:
    """The channels to the master and to the slave."""

    master: Channels
    slave: Channels

    def __post_init__(self) -> None:
        if not self.master.stiffness + self.slave.stiffness > 0.0:
            raise RangeError("Scheme.slave", self.slave, "expected a stiffness: without any the positions drift apart")


def position_position(stiffness: float = 400.0, damping: float = 30.0) -> Scheme:
    """Each device is drawn to where the other is."""
    both = Channels(stiffness, damping)
    return Scheme(both, both)


def position_force(stiffness: float = 400.0, damping: float = 30.0, force: float = 1.0) -> Scheme:
    """The slave is drawn to the master, and what it touches is felt there."""
    return Scheme(Channels(remote_force=force), Channels(stiffness, damping))


def four_channel(stiffness: float = 400.0, damping: float = 30.0, share: float = 0.5) -> Scheme:
    """Positions and forces both ways (Lawrence, 1993): each device gives a share of its outer force for the other's.

    Without delay and with equal devices both move as one of mass m / share, and what one touches the other feels.
    """
    both = Channels(stiffness, damping, share, share)
    return Scheme(both, both)


@dataclass(frozen=True)
class Channel:
    """One direction: packets arrive after ``delay`` and up to ``jitter`` more [s]; a part ``loss`` never does.

    Packets that others have overtaken are of no use; between packets the last one holds.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "delay", "jitter", low=0.0, high=LONGEST, unit="s")
        validation.own_scalars(self, "loss", low=0.0, high=1.0)
        if self.loss == 1.0:
            raise RangeError("Channel.loss", self.loss, "expected less than 1: nothing would arrive")

    def newest(self, ticks: int, dt: float, generator: np.random.Generator) -> Array:
        """For each tick 1 + the number of the newest packet that is there, 0 for none yet [ticks]."""
        sent = np.arange(ticks)
        late = generator.integers(0, round(self.jitter / dt) + 1, ticks) + round(self.delay / dt)
        there = sent + late
        kept = (there < ticks) & (generator.random(ticks) >= self.loss)
        out = np.zeros(ticks, dtype=int)
        np.maximum.at(out, there[kept], sent[kept] + 1)
        return np.asarray(np.maximum.accumulate(out))


@dataclass(frozen=True)
class Bilateral:
    """Two devices that an operator and an environment touch, coupled over a link with delay.

    With ``passivity`` each side gives out only as much energy as the other has taken in and told of (time-domain
    passivity, see :class:`wbc.teleop.bilateral.run.Port`): no gains, delays, jitter or losses can make it unstable with
    an operator and an environment that are passive. Without, only what is absolutely stable by Llewellyn's criterion at
    a constant delay is accepted, unless ``unchecked``.

    Attributes:
        forward: to the slave. backward: to the master. dt: control period [s].

    Raises:
        RangeError: a bound is broken, and which.
    """

    scheme: Scheme
    master: Device = Device()
    slave: Device = Device()
    forward: Channel = Channel()
    backward: Channel = Channel()
    dt: float = 0.002
    passivity: bool = True
    unchecked: bool = False

    def __post_init__(self) -> None:
        dt = validation.scalar("dt", self.dt, low=0.0, open_low=True, unit="s")
        kinds = (("scheme", Scheme), ("master", Device), ("slave", Device), ("forward", Channel), ("backward", Channel))
        for name, kind in kinds:
            validation.instance(name, getattr(self, name), kind, f"a {kind.__name__}")
        self.master.check("master", dt)
        self.slave.check("slave", dt)
        if validation.flag("passivity", self.passivity) or validation.flag("unchecked", self.unchecked):
            return
        for name, link in (("forward", self.forward), ("backward", self.backward)):
            if link.jitter or link.loss:
                raise RangeError(name, link, "without passivity control only a constant delay can be judged")
        sides = [
            Side(
                a.mass / dt, a.damping - 0.5 * a.stiffest * dt, c.stiffness * dt, c.damping,
                c.remote_force, c.local_force,
            )
            for a, c in ((self.master, self.scheme.master), (self.slave, self.scheme.slave))
        ]  # fmt: skip
        delays = round(self.forward.delay / dt), round(self.backward.delay / dt)
        if why := absolute_stability(sides[0], sides[1], *delays, dt):
            raise RangeError("scheme", self.scheme, f"{why}; change gains, or use passivity=True")
