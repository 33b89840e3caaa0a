"""What a bilateral teleoperator consists of: two devices, the channels between them, and the links that carry them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.teleop.bilateral.stability import Side, absolute_stability
from wbc.validation import Array

#: Delays and jitters beyond this are no link [s]
LONGEST = 10.0


def _non_negative(of: object, kind: str, names: tuple[str, ...]) -> None:
    for name in names:
        validation.scalar(f"{kind}.{name}", getattr(of, name), low=0.0)


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
        _non_negative(self, "Device", ("damping", "stiffest", "most_damped"))
        validation.scalar("Device.mass", self.mass, low=0.0, open_low=True, unit="kg")

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
        _non_negative(self, "Channels", ("stiffness", "damping", "remote_force"))
        validation.scalar("Channels.local_force", self.local_force, low=0.0, high=1.0)


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
        for name in ("delay", "jitter"):
            validation.scalar(f"Channel.{name}", getattr(self, name), low=0.0, high=LONGEST, unit="s")
        if validation.scalar("Channel.loss", self.loss, low=0.0, high=1.0) == 1.0:
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
