"""Limbs that hold no more but are still where they held are lifted off first, so that the rest can be planned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.climb.clear import Clearances, sunk_tips
from wbc.climb.climber import Climber
from wbc.climb.closure import CLOSED, Closure
from wbc.climb.motion import MotionOptions, MoveError, carry_out
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene, Foothold, size_of
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.surfaces import frame_on
from wbc.multibody import pin
from wbc.validation import Array

#: How far such a limb is lifted, as shares of the shortest limb's reach, the first that can be
LIFTS = (0.08, 0.04, 0.12, 0.02)
#: Directions of a lift: so much away from the body for one along the normal, as a folded elbow does not go straight up
AWAY_FROM_BODY = (0.0, 1.0)


def lifts(climber: Climber, q: Array, limb: int, normal: Array, shares: Sequence[float]) -> list[Array]:
    """Displacements by which a limb may leave what it holds, d = l (n + a t), those along the normal n first; t points
    away from the body along the surface.

    Args:
        q: configuration ``(nq)``. limb: its row. normal: of the surface ``(3)``.
        shares: lengths l in shares of the shortest limb's reach.

    Returns:
        In the world ``(3)`` each [m].
    """
    away = climber.contact_pose(q, limb).translation - climber.body_pose(q).translation
    away = away - (away @ normal) * normal
    away = away / max(float(np.linalg.norm(away)), 1e-9)
    reach = size_of(climber)
    return [share * reach * (normal + part * away) for part in AWAY_FROM_BODY for share in shares]


def let_go(
    climber: Climber, scene: ClimbScene, start: Stance, options: MotionOptions
) -> tuple[ContactPlan | None, Stance]:
    """The motion on which limbs in the air that touch a body leave it, and where the robot is then.

    Returns:
        None and the start, where no limb in the air touches, or none can be lifted.
    """
    clearances, contacts = Clearances(climber, scene, options.clearance), list(start.contacts)
    footholds: list[Foothold] = []
    near = clearances.standing(contacts, start.q) if FREE_LIMB in contacts else None
    left, held = scene, len(scene.footholds)
    while near is not None:
        limb = next((k for k, at in enumerate(start.contacts) if at == FREE_LIMB and contacts[k] == FREE_LIMB
                     and {near.first, near.second} & _links(climber, k)), None)  # fmt: skip
        body = next((name for name in (near.first, near.second) if name in scene.bodies), None)
        if limb is None or body is None:
            return None, start
        contacts[limb] = held + len(footholds)
        footholds.append(Foothold(f"left by {climber.limbs[limb].name}", _frame(climber, scene, start, limb), body))
        left = replace(scene, footholds=[*scene.footholds, *footholds])
        near = Clearances(climber, left, options.clearance).standing(contacts, start.q)
    if not footholds:
        return None, start
    freed = [limb for limb, at in enumerate(contacts) if at >= held]
    closure, first = Closure(climber), Stance(tuple(contacts), start.q)
    ways = [lifts(climber, start.q, limb, left.normals[contacts[limb]], LIFTS) for limb in freed]
    for lifted in zip(*ways, strict=True):
        poses = {limb: climber.contact_pose(start.q, limb) for limb in freed}
        wanted = {
            limb: pin.SE3(pose.rotation, pose.translation + lift)
            for (limb, pose), lift in zip(poses.items(), lifted, strict=True)
        }
        # Limbs of few joints turn as they are lifted
        q, left_over = closure.closed(start.q, wanted, 0.0, not closure.short.intersection(freed))
        raised = Stance(start.contacts, q)
        if left_over > 10.0 * CLOSED or clearances.standing(raised.contacts, q) is not None:
            continue
        try:
            plan = carry_out(climber, left, StancePath((first, raised), np.zeros(1)), options)
        except MoveError:
            continue
        return replace(plan, scene=scene, start=start.contacts, moves=[]), raised
    return None, start


def joined(first: ContactPlan, then: ContactPlan) -> ContactPlan:
    """One plan after the other, which begins at rest where the first ends; the first has no moves."""
    last = float(first.times[-1])
    moves = [replace(move, lift=move.lift + last, land=move.land + last) for move in then.moves]
    parts = [
        np.concatenate([a, b[1:]]) for a, b in ((first.times, then.times + last), (first.q, then.q), (first.v, then.v))
    ]
    return replace(then, moves=moves, times=parts[0], q=parts[1], v=parts[2])


def _links(climber: Climber, limb: int) -> set[str]:
    """Names of the links that a limb's last joint moves, and of their pieces."""
    return {name for tip in sunk_tips(climber)[limb] for name in (tip.body.link, tip.body.name)}


def _frame(climber: Climber, scene: ClimbScene, start: Stance, limb: int) -> pin.SE3:
    """Where a limb is, with its contact's axis, or that of the nearest foothold where the contact has none."""
    pose = climber.contact_pose(start.q, limb)
    if climber.fixed(limb) != "position":
        return pose
    nearest = int(np.linalg.norm(scene.positions - pose.translation, axis=1).argmin())
    normal = scene.normals[nearest]
    return frame_on(pose.translation - climber.limbs[limb].contact.height * normal, normal)
