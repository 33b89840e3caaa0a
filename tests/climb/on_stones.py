"""Climbers on stones: scenes and stances for tests, made without a search."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.joint_values import beyond_limits
from wbc.climb.scene import ClimbScene, Foothold, SceneBody
from wbc.climb.stance import Stance, StancePath
from wbc.climb.surfaces import frame_on
from wbc.shapes import Box


def on_stones(
    climber: Climber, rng: np.random.Generator, step: float, together: int = 1, thickness: float = 0.04
) -> tuple[ClimbScene, StancePath]:
    """A robot at rest with a stone under every contact, that steps onto stones nearby, some limbs at once, its body
    half of the way each time; at last the body goes back.
    """
    closure = Closure(climber)
    at, kinds = closure.poses(climber.rest), [limb.contact for limb in climber.limbs]
    frames = [
        frame_on(pose.translation - [0.0, 0.0, kinds[limb].height], [0.0, 0.0, 1.0])
        if climber.fixed(limb) == "position"
        else pose
        for limb, pose in enumerate(at)
    ]
    held = {limb: kinds[limb].held_at(frame) for limb, frame in enumerate(frames)}
    q, left = closure.closed(climber.rest, held)
    assert left < 1e-6
    footholds, bodies = list[Foothold](), dict[str, SceneBody]()

    def stone(frame: pin.SE3) -> int:
        name = f"stone {len(footholds)}"
        bodies[name] = SceneBody(
            Box((0.06, 0.06, thickness)), frame * pin.SE3(np.eye(3), np.array([0.0, 0.0, -thickness / 2]))
        )
        footholds.append(Foothold(f"on {name}", frame, name))
        return len(footholds) - 1

    contacts = [stone(frame) for frame in frames]
    stances = [Stance(tuple(contacts), q)]
    limbs = list(range(len(at)))
    for group in [limbs[k :: max(1, len(limbs) // together)] for k in range(max(1, len(limbs) // together))]:
        for _ in range(50):
            kept = len(footholds)
            next_ = list(contacts)
            for limb in group:
                across = step * rng.uniform(-1.0, 1.0, 3) * [1.0, 1.0, 0.2]
                place = pin.SE3(pin.exp3(rng.uniform(-0.15, 0.15, 3)), across + np.sign(across) * [0.08, 0.08, 0.0])
                next_[limb] = stone(footholds[contacts[limb]].pose * place)
            body = climber.body_pose(stances[-1].q)
            turned = body.rotation @ pin.exp3(rng.uniform(-0.05, 0.05, 3))
            moved = pin.SE3(turned, body.translation + 0.3 * step * rng.uniform(-1.0, 1.0, 3))
            wanted = {limb: kinds[limb].held_at(footholds[row].pose) for limb, row in enumerate(next_)}
            q, left = closure.closed(climber.with_body(stances[-1].q, moved), wanted)
            scene = ClimbScene(footholds, bodies, np.zeros(3))
            clear = Clearances(climber, scene)
            if left < 1e-6 and beyond_limits(climber.robot, q[None]) is None:
                before = stances[-1]
                if clear.standing(next_, q) is None and clear.standing(before.contacts, before.q) is None:
                    stances.append(Stance(tuple(next_), q))
                    contacts = next_
                    break
            for name in list(bodies)[kept:]:
                del bodies[name]
            del footholds[kept:]
    scene = ClimbScene(footholds, bodies, np.zeros(3))
    return scene, StancePath(stances, np.zeros(len(stances) - 1))
