"""An arm under a controller: the plant of the listing, and two that close the loop.

listing  motors with the torque that was asked for, H and h at the desired state: no closed loop
torque   a rigid arm (Pinocchio), torques held over a step
motor    a rigid arm (Pinocchio) on its motors, voltages held over a step
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.motion_control.motion import Motion, TorqueController
from wbc.multibody import pin
from wbc.published.newton_euler.actuators import DriveTrain, discretised
from wbc.published.newton_euler.dynamics import Rigid
from wbc.validation import Array

#: Plants of :func:`simulate`
PLANTS = ("listing", "torque", "motor")
#: Steps of the fourth-order integrator in one step of the controller
SUBSTEPS = 20
#: The rule is stable for steps below this, divided by the fastest pole of the motors
STABLE = 2.5
Rate = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """A simulated run, a row a step.

    Attributes:
        times: [steps + 1] [s]. q, v: positions and velocities [steps + 1, n]. errors: desired less actual positions
            [steps + 1, n]. nominal: torques for the desired motion, torques: those that acted, [steps, n].
        voltages: inputs of the motors [steps, n] [V, or openings of valves], zero for the plant ``torque``.
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


def simulate(
    model: pin.Model,
    controller: TorqueController,
    motion: Motion,
    *,
    dt: float = 0.01,
    steps: int = 100,
    plant: str = "torque",
    drive: DriveTrain | None = None,
    substeps: int = SUBSTEPS,
    offset: Array | None = None,
    noise: float = 0.0,
    seed: int = 0,
) -> SimulatedRun:
    """Let a controller follow a motion from its start, where the arm already moves as desired.

    Args:
        model: of the plant. plant: of :data:`PLANTS`; all but ``torque`` need a ``drive``. offset: of the first
            positions [n]. noise: standard deviation of measured positions [rad, m]; where there is any, velocities are
            their differences over a step.

    Raises:
        UnknownNameError: no such plant. RangeError: a plant without drive; motors that are too fast for ``substeps``,
            which says how many they need; the arm ran away.
    """
    validation.one_of("plant", plant, PLANTS)
    validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    validation.integer("substeps", substeps, low=1)
    if drive is None and plant != "torque":
        raise RangeError("drive", drive, f"the plant {plant!r} needs motors")
    if drive is not None and plant == "motor":
        least = int(np.ceil(dt * np.abs(np.linalg.eigvals(drive.system[0])).max() / STABLE))
        if substeps < least:
            raise RangeError("substeps", substeps, f"too few for these motors: expected at least {least}")
    exact, data = Rigid(model), model.createData()
    q, v, a = motion(0.0)
    q = q if offset is None else q + validation.ordinary_array("offset", offset, q.shape)
    validation.scalar("noise", noise, low=0.0)
    random = np.random.default_rng(validation.integer("seed", seed))
    seen, rate, z = q, v, np.zeros(0)
    if drive is not None:
        z = drive.steady(exact.equations(q, v), q, v, exact.equations(q, v).torque(a))
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
            voltage = drive.voltage(exact.equations(*at), seen, rate, torque, z, dt)
        logged.append((q, v, qd - q, np.array(pin.rnea(model, data, qd, vd, ad)), torque, voltage))
        if drive is not None and plant == "listing":
            q, v, z = _as_listed(drive, drive.state(q, v, z), voltage, torque, dt)
        else:
            moves = _moved(model, data, torque)
            if drive is not None and plant == "motor":
                moves = _driven(drive, exact, voltage)
            q, v, z = np.split(_advanced(moves, np.concatenate([q, v, z]), dt, substeps), [len(q), 2 * len(q)])
        if not np.abs(np.concatenate([q, v])).max() < validation.LARGEST:
            raise RangeError("dt", dt, f"the arm ran away after {k * dt:.3g} s: the step is too coarse for these gains")
    columns = [np.array(column, dtype=np.float64) for column in zip(*logged, strict=True)]
    positions, velocities = np.vstack([columns[0], q]), np.vstack([columns[1], v])
    errors = np.vstack([columns[2], motion(steps * dt)[0] - q])
    return SimulatedRun(np.linspace(0.0, steps * dt, steps + 1), positions, velocities, errors, *columns[3:])


def _advanced(rate: Rate, y: Array, dt: float, substeps: int) -> Array:
    """One step by Runge and Kutta's fourth-order rule."""
    h = dt / substeps
    for _ in range(substeps):
        r1 = rate(y)
        r2 = rate(y + h / 2 * r1)
        r3 = rate(y + h / 2 * r2)
        y = y + h / 6 * (r1 + 2 * r2 + 2 * r3 + rate(y + h * r3))
    return y


def _moved(model: pin.Model, data: pin.Data, torque: Array) -> Rate:
    n = len(torque)

    def rate(y: Array) -> Array:
        q, v = y[:n], y[n : 2 * n]
        return np.concatenate([v, pin.aba(model, data, q, v, torque), 0.0 * y[2 * n :]])

    return rate


def _driven(drive: DriveTrain, exact: Rigid, voltage: Array) -> Rate:
    """(I - T F H) q'' = T (A x + B u + F h), z' by the motors' rows: arm and motors under a voltage."""
    A, B, F, T = drive.system
    TF, Bu, one, n = T @ F, B @ voltage, np.eye(len(voltage)), len(voltage)

    def rate(y: Array) -> Array:
        q, v, z = y[:n], y[n : 2 * n], y[2 * n :]
        model = exact.equations(q, v)
        alone = A @ drive.state(q, v, z) + Bu
        a = np.asarray(np.linalg.solve(one - TF @ model.H, T @ alone + TF @ model.h), dtype=np.float64)
        return np.concatenate([v, a, (alone + F @ model.torque(a))[drive.inner]])

    return rate


def _as_listed(drive: DriveTrain, x: Array, voltage: Array, torque: Array, dt: float) -> tuple[Array, Array, Array]:
    """The motors alone, with the torque that was asked for as their load (4.9)."""
    A, B, F, _ = drive.system
    Phi, E = discretised(A, dt, 36)
    x = Phi @ x + E @ (B @ voltage + F @ torque)
    return x[drive.angles] / drive.gears, x[drive.angles + 1] / drive.gears, x[drive.inner]
