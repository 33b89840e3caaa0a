"""Steps of a climber on the footholds of a scene, one limb after the other, drawn without a search."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.joint_values import beyond_limits
from wbc.climb.scene import ClimbScene
from wbc.climb.scenes import ClimbCourse, placed
from wbc.climb.stance import Stance, StancePath
from wbc.validation import Array


def on_course(climber: Climber, course: ClimbCourse, rng: np.random.Generator, count: int) -> StancePath | None:
    """Up to ``count`` steps from a stance near the start; None where no stance was drawn."""
    closure, clear = Closure(climber), Clearances(climber, course.scene)
    for _ in range(60):
        across = rng.uniform(-0.05, 0.05, 3) * [1.0, 1.0, 0.3]
        q = placed(climber, course.start * pin.SE3(pin.exp3(rng.uniform(-0.05, 0.05, 3)), across))
        contacts = list[int]()
        for pose in closure.poses(q):
            near = np.argsort(np.linalg.norm(course.scene.positions - pose.translation, axis=1))
            contacts.append(next(int(row) for row in near if row not in contacts))
        first = _stance(closure, clear, course.scene, contacts, q)
        if first is not None:
            break
    else:
        return None
    stances = [first]
    for _ in range(20 * count):
        if len(stances) > count:
            break
        limb, last = (len(stances) - 1) % len(contacts), stances[-1]
        at = course.scene.positions[last.contacts[limb]]
        near = np.argsort(np.linalg.norm(course.scene.positions - at, axis=1))[1:12]
        row = int(rng.choice([k for k in near if k not in last.contacts]))
        body = climber.body_pose(last.q)
        shift = 0.3 * (course.scene.positions[row] - at) / len(contacts) + rng.uniform(-0.01, 0.01, 3)
        moved = pin.SE3(body.rotation @ pin.exp3(rng.uniform(-0.03, 0.03, 3)), body.translation + shift)
        next_ = [row if k == limb else held for k, held in enumerate(last.contacts)]
        stance = _stance(closure, clear, course.scene, next_, climber.with_body(last.q, moved))
        if stance is not None:
            stances.append(stance)
    return StancePath(stances, np.zeros(len(stances) - 1)) if len(stances) > 1 else None


def _stance(closure: Closure, clear: Clearances, scene: ClimbScene, contacts: list[int], q: Array) -> Stance | None:
    wanted = {limb: scene.footholds[row].pose for limb, row in enumerate(contacts)}
    if any(closure.climber.fixed(limb) == "pose" for limb in wanted):
        # Holds that may be rolled are held as the hand comes
        poses = closure.poses(q)
        for limb, pose in wanted.items():
            turn = pin.Quaternion.FromTwoVectors(poses[limb].rotation[:, 2], pose.rotation[:, 2]).matrix()
            wanted[limb] = pin.SE3(turn @ poses[limb].rotation, pose.translation)
    q, left = closure.closed(q, wanted)
    if left > 1e-7 or beyond_limits(closure.climber.robot, q[None]) or clear.standing(contacts, q) is not None:
        return None
    return Stance(tuple(contacts), q)
