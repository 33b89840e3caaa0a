"""The published controllers and today's on the published task, with a payload that none of them knows of."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from wbc import style, validation
from wbc.errors import RangeError
from wbc.published.newton_euler.control import ERROR_WEIGHT, Adaptive, Controller, Linearised, Nominal, OneStep
from wbc.published.newton_euler.decoupling import DecoupledArm, DecoupledTwo
from wbc.published.newton_euler.simulation import Run, rigid, simulate
from wbc.published.newton_euler.three_link import arm, task, tip
from wbc.published.newton_euler.today import ComputedTorque, SlotineLi
from wbc.validation import Array

_ARM, _TASK = arm(), task()
#: Preview of controller 2 [s]: the step of the thesis
_PREVIEW = 0.01


def _omega(dt: float) -> float:
    """Both poles of today's controllers [1/s]: half a radian a step at most."""
    return min(100.0, 0.5 / dt)


def _stiff(dt: float) -> Linearised:
    """Controller 1 with errors of positions that weigh as the rates that remove them in one step."""
    return Linearised(_ARM, _TASK, dt, OneStep(3, np.diag([ERROR_WEIGHT / dt**2] * 3 + [ERROR_WEIGHT] * 3)))


def _passivity(dt: float) -> SlotineLi:
    stiffness = _omega(dt) / 2.0
    inertia = np.diag(pin.crba(_ARM.model, _ARM.model.createData(), _TASK(0.0)[0]))
    # Mass and first moment are learned ten times as fast as inertia
    rate = np.array([1.0] * 4 + [0.1] * 6) / dt
    return SlotineLi(_ARM.model, _TASK, dt, stiffness=stiffness, damping=stiffness * inertia, rate=rate)


#: Name -> controller for a step [s]
LAWS: dict[str, Callable[[float], Controller]] = {
    "nominal torque": lambda dt: Nominal(_ARM, _TASK),
    "1 linearised": lambda dt: Linearised(_ARM, _TASK, dt),
    "1 with stiff weights": _stiff,
    "2 decoupled": lambda dt: DecoupledTwo(_TASK, _PREVIEW),
    "2 on all joints": lambda dt: DecoupledArm(rigid(_ARM.model), _TASK, _PREVIEW),
    "3 adaptive": lambda dt: Adaptive(_ARM, _TASK, dt),
    "computed torque": lambda dt: ComputedTorque(_ARM.model, _TASK, _omega(dt)),
    "Slotine and Li": _passivity,
}


@dataclass(frozen=True, eq=False)
class Compared:
    """One controller on the task.

    Attributes:
        name: of :data:`LAWS`. run: what it did; None where the arm ran away. tip: distance of the tip from where it
            should be, of each sample [m]. microseconds: of one command, the median, in Python. mass: of the payload
            as it was learned [kg], if anything is.
    """

    name: str
    run: Run | None
    tip: Array
    microseconds: float
    mass: float | None


class _Timed:
    def __init__(self, controller: Controller) -> None:
        self.controller, self.seconds = controller, list[float]()

    def command(self, time_: float, q: Array, v: Array) -> Array:
        start = time.perf_counter()
        out = self.controller.command(time_, q, v)
        self.seconds.append(time.perf_counter() - start)
        return out


def loaded(payload: float, heavier: float = 1.0) -> pin.Model:
    """The arm with a point mass at its tip [kg], and with links so many times heavier than they are thought to be."""
    validation.scalar("payload", payload, low=0.0, high=100.0, unit="kg")
    validation.scalar("heavier", heavier, low=0.1, high=10.0)
    model = _ARM.model.copy()
    for i in range(1, model.njoints):
        body = model.inertias[i]
        model.inertias[i] = pin.Inertia(heavier * body.mass, body.lever, heavier * body.inertia)
    if payload > 0.0:
        # The tip is the origin of joint 3 at q3 = 0
        model.inertias[3] = model.inertias[3] + pin.Inertia(payload, np.zeros(3), np.zeros((3, 3)))
    return model


def compare(
    payload: float, dt: float, names: Sequence[str] = tuple(LAWS), *, heavier: float = 1.0, noise: float = 0.0
) -> Iterator[Compared]:
    """The controllers one by one, with a payload [kg] and a step [s].

    ``heavier`` as for :func:`loaded`; ``noise`` of measured positions [rad, m] as for :func:`simulate`.

    Raises:
        UnknownNameError: no such controller. RangeError: a payload out of range, or a step that does not divide 1 s.
    """
    model = loaded(payload, heavier)
    chosen = [validation.one_of("controller", name, LAWS) for name in names]
    validation.scalar("dt", dt, low=1e-4, high=0.1, unit="s")
    steps = round(1.0 / dt)
    if abs(steps * dt - 1.0) > 1e-9:
        raise RangeError("dt", dt, "expected a whole number of steps in 1 s")
    for name in chosen:
        timed = _Timed(LAWS[name](dt))
        try:
            run = simulate(model, timed, _TASK, dt=dt, steps=steps, substeps=max(1, round(dt / 5e-4)), noise=noise)
            off = np.array([np.linalg.norm(tip(q) - tip(_TASK(t)[0])) for q, t in zip(run.q, run.times, strict=True)])
        except RangeError as error:
            if error.field != "dt":
                raise
            run, off = None, np.zeros(0)
        law = timed.controller
        mass = float(law.theta[0]) if isinstance(law, SlotineLi) else None
        yield Compared(name, run, off, 1e6 * float(np.median(timed.seconds)), mass)


def save_plot(found: Sequence[Compared], title: str, path: Path) -> None:
    """Errors of the tip, and the torques of joints 2 and 3, over time."""
    with style.pyplot() as plt:
        figure, axes = plt.subplots(3, 1, figsize=(9, 10), sharex=True, layout="constrained")
        for one, colour in zip(found, style.CYCLE, strict=False):
            if one.run is None:
                continue
            axes[0].semilogy(one.run.times[1:], 1e3 * np.maximum(one.tip[1:], 1e-9), color=colour, label=one.name)
            for axis, joint in zip(axes[1:], (1, 2), strict=True):
                axis.step(one.run.times[:-1], one.run.torques[:, joint], where="post", color=colour)
        axes[0].set(title=title, ylabel="tip off [mm]", ylim=(1e-3, None))
        axes[1].set(ylabel="joint 2 [N m]", ylim=(-60, 60))
        axes[2].set(ylabel="joint 3 [N]", ylim=(-20, 120), xlabel="time [s]")
        figure.legend(loc="outside lower center", ncols=3)
        figure.savefig(path)
        plt.close(figure)
