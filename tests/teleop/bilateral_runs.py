"""Runs of bilateral teleoperation for tests and for the bench: a smooth way there and back, and wild random systems."""

from __future__ import annotations

import dataclasses

import numpy as np

from wbc.teleop.bilateral import Bilateral, Channel, Channels, Device, Operator, Scheme, Wall

#: Control period [s]
DT = 0.005


def reach(size: float = 0.3, seconds: float = 6.0, n: int = 1, axis: int = 0) -> np.ndarray:
    """A smooth way there in 2 s, 2 s of rest, and back."""
    t = np.arange(round(seconds / DT)) * DT
    out = np.zeros((len(t), n))
    for start, sign in ((0.0, 1.0), (4.0, -1.0)):
        s = np.clip((t - start) / 2.0, 0.0, 1.0)
        out[:, axis] += sign * size * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return out


def drawn(rng: np.random.Generator, ticks: int) -> tuple[Bilateral, Operator, Wall]:
    """Anything that is accepted with passivity control: wild gains, devices at their bounds, broken links."""

    def device() -> Device:
        stiffest, damped = 10 ** rng.uniform(1, 4), 10 ** rng.uniform(-1, 2)
        tight = rng.random() < 0.3
        mass, damping = (1.0 if tight else 10 ** rng.uniform(0, high) for high in (3, 1.5))
        return Device(damped * DT * mass, stiffest * DT / 2 * damping, stiffest, damped)

    def channels() -> Channels:
        on = rng.random(4) < (0.85, 0.7, 0.5, 0.5)
        gains = (10 ** rng.uniform(0, 4.5), 10 ** rng.uniform(-1, 3), 3 * rng.random(), rng.random())
        return Channels(*(float(gain) if there else 0.0 for gain, there in zip(gains, on, strict=True)))

    def link() -> Channel:
        return Channel(rng.uniform(0, 0.6), rng.uniform(0, 0.3) * (rng.random() < 0.5), 0.9 * rng.random())

    slave = dataclasses.replace(channels(), stiffness=10 ** rng.uniform(0, 4.5))
    system = Bilateral(Scheme(channels(), slave), device(), device(), link(), link(), DT)
    knots, places = np.sort(rng.integers(0, ticks // 2, 5)), rng.normal(size=(5, 2)) * 0.3
    path = np.column_stack([np.interp(np.arange(ticks), knots, places[:, c]) for c in range(2)])
    part = rng.random(4)
    hand = Operator(path, system.master.stiffest * part[0], system.master.most_damped * part[1])
    at = rng.choice([np.inf, 0.0, 0.05, -0.1])
    return system, hand, Wall(at, system.slave.stiffest * part[2], system.slave.most_damped * part[3])
