"""Where a robot stood at an instant of a climb's log, from which a climb can go on."""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.closure import CLOSED, Closure
from wbc.climb.loop.loop import STILL
from wbc.climb.loop.records import scene_digest
from wbc.climb.motion import MotionOptions
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.turn import BodyTurn
from wbc.climb.world import held_pose
from wbc.errors import InfeasibleError, ShapeError
from wbc.log import Log
from wbc.multibody import pin
from wbc.validation import Array

#: How far a configuration of a log may be from the stance that it is taken for [m, rad]: limbs under torques close
#: up to 7.5 mm beside their footholds
NEAR_STANCE = 0.02
#: A limb that has come this near to the foothold that it was going to holds it [m]
COME_TO = 1e-3
#: Time in which limbs in the air come to rest at least [s], and share of the joints' accelerations for that at most [1]
COASTS = 0.25
SLOWING = 0.5


def stance_in(log: Log, climber: Climber, scene: ClimbScene, at: float | None = None) -> Stance:
    """The stance at an instant: closed limbs at their footholds, those that had come to theirs too, other limbs in the
    air free, contacts closed exactly.

    Args:
        at: time [s]; None: the last one.

    Raises:
        ShapeError: the log is of another robot or scene, or of no climb. RangeError: a time that is not in the log.
        InfeasibleError: limbs that were closed then cannot be at their footholds.
    """
    row = _row(log, climber, scene, at)
    when, q, contacts = log["t"][row], log.array("q")[row], [int(k) for k in log.array("contact")[row]]
    q = climber.robot.configuration(
        "log.q", q / np.r_[np.ones(3), np.full(4, np.linalg.norm(q[3:7])), np.ones(len(q) - 7)]
    )
    for limb, aim in enumerate(log.array("aim")[row].astype(int).tolist()):
        if aim == FREE_LIMB or aim >= len(scene.footholds) or aim in contacts:
            continue
        off = climber.contact_pose(q, limb).translation - held_pose(climber, scene, limb, aim, q).translation
        if np.linalg.norm(off) < COME_TO:
            contacts[limb] = aim
    held = {limb: held_pose(climber, scene, limb, hold, q) for limb, hold in enumerate(contacts) if hold != FREE_LIMB}
    if not held:
        raise InfeasibleError("at", when, "no limb held anything then")
    closed, left = Closure(climber).closed(q, held)
    moved = float(np.abs(pin.difference(climber.robot.model, q, closed)).max())
    if left > 1e3 * CLOSED or moved > NEAR_STANCE:
        raise InfeasibleError(
            "at", when, f"limbs that held then are {max(left, moved):.3g} m or rad off their footholds"
        )
    return Stance(tuple(contacts), closed)


def coming_to_rest(
    log: Log, climber: Climber, scene: ClimbScene, at: float | None = None, options: MotionOptions | None = None
) -> ContactPlan | None:
    """How a robot that moves at an instant of its log comes to rest, proven clear: body and limbs in the air evenly,
    limbs that hold where they do.

    Args:
        at: time [s]; None: the last one. options: clearances and limits that are kept.

    Returns:
        None where it is at rest, or no such way is proven.

    Raises:
        What :func:`stance_in` raises.
    """
    stance, v = stance_in(log, climber, scene, at), log.array("v")[_row(log, climber, scene, at)]
    if float(np.abs(v).max()) <= STILL:
        return None
    robot = climber.robot
    able = robot.limits.acceleration[robot.base_nv :] > 0.0
    slowing = np.abs(v[robot.base_nv :][able]) / (SLOWING * robot.limits.acceleration[robot.base_nv :][able])
    coasts = max(COASTS, float(slowing.max(initial=0.0)))

    def falling(time: float) -> Array:
        part = min(time, coasts)
        return np.asarray(pin.integrate(robot.model, stance.q, part * (1.0 - 0.5 * part / coasts) * v))

    return BodyTurn(climber, scene, options or MotionOptions()).planned(stance, v, np.zeros(6), falling, lasts=coasts)


def _row(log: Log, climber: Climber, scene: ClimbScene, at: float | None) -> int:
    """The row of an instant."""
    validation.instance("log", log, Log, "a Log")
    for field, own in (("robot_digest", climber.robot.fingerprint), ("scene_digest", scene_digest(scene))):
        if log.meta.get(field) != own:
            was = log.meta.get(field.removesuffix("_digest"))
            raise ShapeError("log", was, f"its {field.removesuffix('_digest')} is another one than was given")
    t = log["t"]
    when = float(t[-1]) if at is None else validation.scalar("at", at, low=float(t[0]), high=float(t[-1]), unit="s")
    return int(np.searchsorted(t, when + 1e-9, side="right")) - 1
