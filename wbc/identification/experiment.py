"""A whole identification on a simulated robot: a motion that shows much, torques with noise, a fit, and a check.

The simulated robot is not the one that is believed: its bodies are heavier or lighter and their inertias elsewhere, and
its joints rub. It follows the motion under computed torque with the believed model and encoders that are noisy.
Velocities and accelerations are differences of what the encoders say behind a low-pass filter without delay; torques
pass the same filter. The check is the same on another motion, which the fit has not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import expm

from wbc import validation
from wbc.errors import RangeError
from wbc.identification.exciting import ExcitingMotion, exciting_motion
from wbc.identification.fit import Identified, identify
from wbc.identification.pseudo_inertia import is_body, model_parameters, parameters, pseudo_inertia
from wbc.identification.regression import SLOW, Regression, Samples
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.simulation import Command, CommandKind, Motors, PinocchioPlant
from wbc.trajectory import Law
from wbc.validation import Array

#: Rate of the encoders [1/s]
RATE = 250.0
#: Cut-off frequency of the filter [Hz]
CUT = 8.0
#: Rate of samples whose noise is independent behind the filter [1/s]
KEPT = 16.0
#: Time at each end that the filter spoils [s]
EDGE = 0.3
#: Poles of the computed torque that follows the motion [1/s]
POLE = 20.0
#: Viscous and Coulomb friction and noise of the torques, each by the inertia that a joint moves [1/s, 1/s^2, 1/s^2]
RUBBING = (1.0, 0.5, 1.0)
#: How far the true bodies are from those believed: standard deviation of the logarithms of masses and moments
FAR = 0.2


@dataclass(frozen=True, eq=False)
class Experiment:
    """What was done and found.

    Attributes:
        true: robot that moved. motion: that it was to follow. found: by the fit. check: root of the mean square of the
            torques of another motion that the found parameters do not explain, and that the believed ones do not, of
            each degree of freedom [N m or N], ``[2, nv]``. errors: of the base parameters, in standard deviations.
    """

    true: Robot
    motion: ExcitingMotion
    found: Identified
    check: Array
    errors: Array

    @property
    def deviations(self) -> float:
        """Root of the mean square of the errors of the base parameters, in standard deviations."""
        return float(np.sqrt((self.errors**2).mean()))

    def data(self) -> dict[str, Any]:
        """Numbers for a file: of the motion, the fit and its check, and the inertias that were found."""
        motion, found, model = self.motion, self.found, self.found.robot.model
        bodies = zip(list(model.names)[1:], list(model.inertias)[1:], strict=True)
        return {
            "robot": self.true.name,
            "parameters": len(found.parameters),
            "base": found.base.count,
            "condition": found.base.condition,
            "score": motion.score,
            "first": motion.first,
            "duration": motion.law.duration,
            "deviations": self.deviations,
            "model": self.check[1].tolist(),
            "fit": self.check[0].tolist(),
            "inertias": {str(name): np.array(body.toDynamicParameters()).tolist() for name, body in bodies},
        }


def changed(robot: Robot, far: float = FAR, seed: int = 0) -> Robot:
    """A robot whose bodies are others: pseudo-inertias U U' become U exp(S) U' with random symmetric S."""
    random, model = np.random.default_rng(validation.integer("seed", seed)), robot.model.copy()
    far = validation.scalar("far", far, low=0.0, high=2.0)
    for j in range(1, model.njoints):
        phi = np.array(model.inertias[j].toDynamicParameters())
        if is_body(phi):
            U, S = np.linalg.cholesky(pseudo_inertia(phi)), far * random.normal(size=(4, 4))
            moved = parameters(U @ expm((S + S.T) / 2.0) @ U.T)
            model.inertias[j] = pin.Inertia.FromDynamicParameters(moved)
    return replace(robot, model=model)


def record(plant: PinocchioPlant, believed: Robot, law: Law, noise: float = 0.0, seed: int = 0) -> Samples:
    """What encoders and motors say of a motion that is followed, filtered.

    Args:
        plant: of the true robot. believed: whose model computes the torques. noise: of encoders, a standard deviation
            [rad, m].

    Raises:
        RangeError: the motion is too short. PlantError: the simulation has blown up.
    """
    model, data, dt = believed.model, believed.model.createData(), 1.0 / RATE
    random = np.random.default_rng(validation.integer("seed", seed))
    steps = int(law.duration * RATE)
    if steps * dt < 4.0 * EDGE:
        raise RangeError("law.duration", law.duration, f"expected at least {4.0 * EDGE:g} s")
    course = law.at(dt * np.arange(steps))
    last = course.position[0]
    plant.reset(last, 0.0)
    q, torques = np.empty((steps, believed.nq)), np.empty((steps, believed.nv))
    for k in range(steps):
        q[k] = plant.read().q + noise * random.normal(size=believed.nq)
        rate, last = (q[k] - last) / dt if k else np.zeros(believed.nv), q[k]
        wanted, speed, change = (part[k] for part in course)
        a = change + 2.0 * POLE * (speed - rate) + POLE**2 * (wanted - q[k])
        torques[k] = np.clip(pin.rnea(model, data, q[k], rate, a), -believed.limits.effort, believed.limits.effort)
        plant.apply(Command(CommandKind.TORQUE, torques[k]))
        plant.advance(dt)
    return filtered(q, torques, dt)


def filtered(q: Array, torque: Array, dt: float) -> Samples:
    """Samples without the ends: q, its differences and torques behind one low-pass filter, forwards and backwards."""
    # It imports scipy.stats: two fifths of the time that importing this module took
    from scipy.signal import butter, filtfilt

    b, a = butter(4, CUT * 2.0 * dt)
    smooth, load = filtfilt(b, a, q, axis=0), filtfilt(b, a, torque, axis=0)
    v = np.gradient(smooth, dt, axis=0)
    keep = slice(round(EDGE / dt), len(q) - round(EDGE / dt), round(1.0 / (KEPT * dt)))
    return Samples(smooth[keep], v[keep], np.gradient(v, dt, axis=0)[keep], load[keep])


def experiment(
    robot: Robot,
    *,
    far: float = FAR,
    noise: float = 1e-5,
    tries: int = 200,
    waypoints: int = 8,
    seed: int = 0,
    tick: Callable[[], None] = lambda: None,
) -> Experiment:
    """Identify a simulated robot whose bodies are not the model's and whose joints rub.

    Args:
        robot: that is believed, on a fixed base. far: how far the true bodies are. noise: of encoders [rad, m].
            tries: motions that are looked at, of so many waypoints; tick: called after each.

    Raises:
        UnsupportedJointError: a base that moves, coupled joints, or joints with coordinates of another number.
        InfeasibleError: no motion keeps the limits of torque. RangeError: numbers out of range.
    """
    noise = validation.scalar("noise", noise, low=0.0, high=0.01)
    regression = Regression(robot, friction=True)
    true = changed(robot, far, seed)
    motion = exciting_motion(regression, waypoints=waypoints, tries=tries, seed=seed, tick=tick)
    other = exciting_motion(regression, waypoints=waypoints, tries=1, seed=seed + 1)
    size = np.diag(pin.crba(robot.model, robot.model.createData(), robot.neutral))
    motors = Motors(viscous=RUBBING[0] * size, coulomb=RUBBING[1] * size, noise=RUBBING[2] * size, slip_speed=SLOW)
    plant = PinocchioPlant(true, 0.5 / RATE, motors=motors, seed=seed)
    samples, unseen = (record(plant, robot, one.law, noise, seed + k) for k, one in enumerate((motion, other)))
    found = identify(regression, samples)
    W, y = regression.stacked(unseen)
    start = np.concatenate([model_parameters(robot.model), np.zeros(2 * robot.nv)])
    truth = np.concatenate([model_parameters(true.model), motors_of(motors)])
    check = [np.sqrt(((y - W @ phi).reshape(-1, robot.nv) ** 2).mean(axis=0)) for phi in (found.parameters, start)]
    errors = (found.values - found.base.combination @ truth) / found.deviations
    return Experiment(true, motion, found, np.array(check), np.asarray(errors))


def motors_of(motors: Motors) -> Array:
    """Viscous and Coulomb friction of motors with a number for each joint."""
    return np.concatenate([np.asarray(motors.viscous), np.asarray(motors.coulomb)])
