"""An arm under a controller: the plant of the listing, and two that close the loop.

listing  motors with the torque that was asked for, H and h at the desired state: no closed loop
torque   a rigid arm (Pinocchio), torques held over a step
motor    a rigid arm (Pinocchio) on its motors, voltages held over a step
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError
from wbc.published.newton_euler.actuators import Drive, discretised
from wbc.published.newton_euler.control import Controller
from wbc.published.newton_euler.recursion import Equations
from wbc.published.newton_euler.three_link import Motion
from wbc.validation import Array

#: Plants of :func:`simulate`
PLANTS = ("listing", "torque", "motor")
#: Steps of the fourth-order integrator in one step of the controller
SUBSTEPS = 20
Acceleration = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Run:
    """A simulated run, a row a step.

    Attributes:
        times: [steps + 1] [s]. q, v: positions and velocities [steps + 1, n]. errors: desired less actual positions
            [steps + 1, n]. nominal: torques for the desired motion, torques: those that acted, [steps, n].
        voltages: [steps, n] [V], zero for the plant ``torque``.
    """

    times: Array
    q: Array
    v: Array
    errors: Array
    nominal: Array
    torques: Array
    voltages: Array

    @property
    def largest(self) -> Array:
        """Largest error of each joint [n]."""
        return np.asarray(np.abs(self.errors).max(axis=0))

    @property
    def perturbation(self) -> Array:
        """Largest torque besides the nominal one, of each joint [n]."""
        return np.asarray(np.abs(self.torques - self.nominal).max(axis=0))


def rigid(model: pin.Model) -> Callable[[Array, Array], Equations]:
    """H and h of a ``pin.Model``, by Pinocchio."""
    data = model.createData()

    def equations(q: Array, v: Array) -> Equations:
        return Equations(np.array(pin.crba(model, data, q)), np.array(pin.nonLinearEffects(model, data, q, v)))

    return equations


def simulate(
    model: pin.Model,
    controller: Controller,
    motion: Motion,
    *,
    dt: float = 0.01,
    steps: int = 100,
    plant: str = "torque",
    drive: Drive | None = None,
    substeps: int = SUBSTEPS,
    offset: Array | None = None,
    noise: float = 0.0,
    seed: int = 0,
) -> Run:
    """Let a controller follow a motion from its start, where the arm already moves as desired.

    Args:
        model: of the plant. plant: of :data:`PLANTS`; all but ``torque`` need a ``drive``. offset: of the first
            positions [n]. noise: standard deviation of measured positions [rad, m]; where there is any, velocities are
            their differences over a step.

    Raises:
        UnknownNameError: no such plant. RangeError: a plant without drive; the arm ran away.
    """
    validation.one_of("plant", plant, PLANTS)
    validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    validation.integer("substeps", substeps, low=1)
    if drive is None and plant != "torque":
        raise RangeError("drive", drive, f"the plant {plant!r} needs motors")
    exact, data = rigid(model), model.createData()
    q, v, _ = motion(0.0)
    q = q if offset is None else q + validation.ordinary_array("offset", offset, q.shape)
    validation.scalar("noise", noise, low=0.0)
    random = np.random.default_rng(validation.integer("seed", seed))
    seen, rate = q, v
    logged: list[tuple[Array, ...]] = []
    for k in range(validation.integer("steps", steps, low=1)):
        qd, vd, ad = motion(k * dt)
        if noise:
            last, seen = seen, q + noise * random.normal(size=q.shape)
            rate = (seen - last) / dt if k else v
        else:
            seen, rate = q, v
        torque = controller.command(k * dt, seen, rate)
        voltage = np.zeros_like(torque)
        if drive is not None:
            at = (qd, vd) if plant == "listing" else (seen, rate)
            voltage = drive.voltage(exact(*at), seen, rate, torque)
        logged.append((q, v, qd - q, np.array(pin.rnea(model, data, qd, vd, ad)), torque, voltage))
        if plant == "torque":
            q, v = _advanced(_moved(model, data, torque), q, v, dt, substeps)
        elif drive is not None and plant == "motor":
            q, v = _advanced(_driven(drive, exact, voltage), q, v, dt, substeps)
        elif drive is not None:
            q, v = _as_listed(drive, q, v, voltage, torque, dt)
        if not np.abs(np.concatenate([q, v])).max() < validation.LARGEST:
            raise RangeError("dt", dt, f"the arm ran away after {k * dt:.3g} s: the step is too coarse for these gains")
    columns = [np.array(column, dtype=np.float64) for column in zip(*logged, strict=True)]
    positions, velocities = np.vstack([columns[0], q]), np.vstack([columns[1], v])
    errors = np.vstack([columns[2], motion(steps * dt)[0] - q])
    return Run(np.linspace(0.0, steps * dt, steps + 1), positions, velocities, errors, *columns[3:])


def _advanced(acceleration: Acceleration, q: Array, v: Array, dt: float, substeps: int) -> tuple[Array, Array]:
    """One step by Runge and Kutta's fourth-order rule."""
    h = dt / substeps
    for _ in range(substeps):
        a1 = acceleration(q, v)
        a2 = acceleration(q + h / 2 * v, v + h / 2 * a1)
        a3 = acceleration(q + h / 2 * v + h * h / 4 * a1, v + h / 2 * a2)
        a4 = acceleration(q + h * v + h * h / 2 * a2, v + h * a3)
        q = q + h * v + h * h / 6 * (a1 + a2 + a3)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return q, v


def _moved(model: pin.Model, data: pin.Data, torque: Array) -> Acceleration:
    def acceleration(q: Array, v: Array) -> Array:
        return np.array(pin.aba(model, data, q, v, torque))

    return acceleration


def _driven(drive: Drive, exact: Callable[[Array, Array], Equations], voltage: Array) -> Acceleration:
    """(I - T F H) q'' = T (A x + B u + F h): arm and motors under a voltage."""
    A, B, F, T = drive.system
    TA, TBu, TF, one = T @ A, T @ B @ voltage, T @ F, np.eye(len(voltage))

    def acceleration(q: Array, v: Array) -> Array:
        model = exact(q, v)
        return np.asarray(np.linalg.solve(one - TF @ model.H, TA @ drive.state(q, v) + TBu + TF @ model.h))

    return acceleration


def _as_listed(drive: Drive, q: Array, v: Array, voltage: Array, torque: Array, dt: float) -> tuple[Array, Array]:
    """The motors alone, with the torque that was asked for as their load (4.9)."""
    A, B, F, _ = drive.system
    Phi, E = discretised(A, dt, 36)
    x = (Phi @ drive.state(q, v) + E @ (B @ voltage + F @ torque)).reshape(-1, 2)
    gears = np.array([motor.gear for motor in drive.motors])
    return x[:, 0] / gears, x[:, 1] / gears
