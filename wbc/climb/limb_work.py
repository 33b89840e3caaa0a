"""One limb works at targets while the others hold and the body stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.climb.balance import Equilibrium
from wbc.climb.climber import Climber
from wbc.climb.let_go import joined, let_go
from wbc.climb.motion import MotionOptions, carry_out
from wbc.climb.plan import ContactPlan
from wbc.climb.reach import LimbReach
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Postures of a limb at a target, of which the one nearest to where it comes from is taken
POSTURES = 6
#: Poses into which a way by a twist is divided: one for so far [m] or so much turn [rad]
STEP = 0.03


def plan_limb_work(
    climber: Climber,
    scene: ClimbScene,
    start: Stance,
    limb: str,
    targets: Sequence[Any],
    options: MotionOptions | None = None,
) -> ContactPlan:
    """A plan on which a limb goes to one target after the other, at rest in each. Limbs in the air that touch a body
    leave it first, as of :func:`let_go`.

        plan_limb_work(climber, scene, stance, "arm3", [pin.SE3(...), "15,12"])

    Args:
        start: where the robot stands; its body stays there. limb: which works.
        targets: ids of footholds, at which it holds, and poses of its contact frame in the world, z from the surface to
            the robot, of which the rows count that its contact fixes.

    Raises:
        UnknownNameError: no such limb or foothold. RangeError: a foothold that another limb holds, or that this one may
            not. InfeasibleError: a target out of reach, or the others do not bear the robot. MoveError: no way to a
            target is clear. ShapeError, NotFiniteError: no targets, or poses that are none.
    """
    row = climber.row(limb)
    if not targets:
        raise ShapeError("targets", (), "expected one target or more")
    given = MotionOptions() if options is None else validation.instance("options", options, MotionOptions, "options")
    balance = Equilibrium(climber, scene)
    lifting, start = let_go(climber, scene, start, given)
    others = tuple(FREE_LIMB if k == row else at for k, at in enumerate(start.contacts))
    if (slack := balance.margin(others, start.q)) < 0.0:
        lack = f"they lack {-slack:.3g} of its weight" if np.isfinite(slack) else "what they hold leaves the body free"
        raise InfeasibleError("limb", limb, f"without it the others do not bear the robot: {lack}")
    reach, stances, kind = LimbReach(climber), [start], climber.limbs[row].contact
    for k, target in enumerate(targets):
        field = f"targets[{k}]"
        at = scene.row(target) if isinstance(target, str) else FREE_LIMB
        if at != FREE_LIMB:
            allowed = scene.footholds[at].limbs
            if at in others or (allowed and limb not in allowed):
                holder = climber.limbs[others.index(at)].name if at in others else ", ".join(allowed)
                raise RangeError(field, target, f"it is for {holder}")
        pose = validation.pose(field, target) if at == FREE_LIMB else kind.held_at(scene.footholds[at].pose)
        angles = _nearest(climber, reach, row, pose, stances[-1].q)
        if angles is None:
            away = float(np.linalg.norm(climber.contact_pose(start.q, row).translation - pose.translation))
            raise InfeasibleError(
                field, target, f"out of reach of {limb} from where the body stands, {away:.3g} m away"
            )
        contacts = tuple(at if j == row else hold for j, hold in enumerate(others))
        stances.append(Stance(contacts, climber.with_limb(stances[-1].q, row, angles)))
    plan = carry_out(climber, scene, StancePath(stances, np.zeros(len(stances) - 1)), given, balance)
    return plan if lifting is None else joined(lifting, plan)


def moved_by(pose: Any, twist: Any, seconds: float) -> list[pin.SE3]:
    """Poses on the way of a frame that moves with a twist for some time, P(t): linear along the world's axes, turning
    about its own origin; the last is where it ends.

    Args:
        twist: (linear; angular) ``(6)`` along the world's axes [m/s, rad/s].

    Raises:
        ShapeError, NotFiniteError, RotationError, RangeError: of arguments.
    """
    begin = validation.pose("pose", pose)
    rates = validation.real_array("twist", twist, (6,))
    lasts = validation.scalar("seconds", seconds, low=0.0, open_low=True, unit="s")
    way = lasts * rates
    count = max(1, int(np.ceil(max(np.linalg.norm(way[:3]), np.linalg.norm(way[3:]) / 5.0) / STEP)))
    return [
        pin.SE3(pin.exp3(part * way[3:]) @ begin.rotation, begin.translation + part * way[:3])
        for part in np.arange(1, count + 1) / count
    ]


def _nearest(climber: Climber, reach: LimbReach, limb: int, pose: pin.SE3, q: Array) -> Array | None:
    """Angles at a pose in the world with the body as it is, nearest to those it has."""
    now = climber.angles(q, limb)
    wanted = place(climber.body_pose(q).actInv(pose))[None]
    angles, solved = reach.postures(limb, wanted, now[None], POSTURES)
    some = angles[0][solved[0]]
    return some[int(np.abs(some - now).max(axis=1).argmin())] if len(some) else None
