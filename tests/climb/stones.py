"""Climbers on few stones: stances made without a search, and a search over all of them that takes its time."""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.first import first_stance
from wbc.climb.scene import ClimbScene, Foothold, SceneBody
from wbc.climb.search import StanceOptions
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.surfaces import frame_on
from wbc.climb.world import ClimbWorld, PostureOutcome
from wbc.robot.joint_values import beyond_limits
from wbc.shapes import Box
from wbc.validation import Array

#: An angle of a limb that holds does not go farther than this in one move [rad]
FLIPPED = 1.5


def stones(climber: Climber, rng: np.random.Generator, count: int, spread: float) -> tuple[ClimbScene, Stance]:
    """A robot on stones near its feet at rest, with ``count`` more ahead of it."""
    feet = [climber.contact_pose(climber.rest, limb).translation for limb in range(len(climber.limbs))]
    under = [foot + spread * np.append(rng.uniform(-0.2, 0.2, 2), rng.uniform(-0.1, 0.1)) for foot in feet]
    low, high = np.min(feet, axis=0), np.max(feet, axis=0)
    ahead = [
        rng.uniform(low, high + spread * np.array([1.0, 0.0, 0.0])) + [0.0, 0.0, 0.1 * spread] for _ in range(count)
    ]
    scene = ClimbScene([_stone(f"{k}", at, rng) for k, at in enumerate(under + ahead)])
    return scene, first_stance(climber, scene, climber.rest, StanceOptions(margin=0.05))


def _stone(name: str, at: Array, rng: np.random.Generator) -> Foothold:
    return Foothold(name, pin.SE3(pin.exp3(np.append(rng.uniform(-0.2, 0.2, 2), 0.0)), at), friction=0.5)


def reached_by_all(
    climber: Climber, scene: ClimbScene, start: Stance, options: StanceOptions, limb: int, rng: np.random.Generator
) -> set[int]:
    """Footholds that a limb comes to over all stances, one limb at a time: breadth first, with every posture sought
    from several places of the body, and no look at the way between postures but that no limb that holds flips over.
    """
    world = ClimbWorld(climber, scene, start, options.limits, options.clearance, options.apart)
    first = world.start
    states = {first: world.state_of(start.q)}
    waiting = deque([first])
    stands: dict[tuple[tuple[int, ...], tuple[int, ...]], Array | None] = {}

    def standing(contacts: tuple[int, ...], bears: tuple[int, ...], state: Array) -> Array | None:
        if (contacts, bears) not in stands:
            stands[contacts, bears] = _sought(world, contacts, bears, state, options.margin, rng)
        return stands[contacts, bears]

    while waiting:
        contacts = waiting.popleft()
        for k in range(len(contacts)):
            kept = tuple(FREE_LIMB if j == k else at for j, at in enumerate(contacts))
            lifted = standing(contacts, kept, states[contacts])
            if lifted is None:
                continue
            free = [at for at in range(len(scene.footholds)) if at not in contacts]
            for at in [*free, FREE_LIMB]:
                after = tuple(at if j == k else held for j, held in enumerate(contacts))
                if after in states:
                    continue
                landed = standing(after, kept, lifted)
                if landed is not None:
                    states[after] = landed
                    waiting.append(after)
    return {contacts[limb] for contacts in states}


def _sought(
    world: ClimbWorld, contacts: tuple[int, ...], bears: tuple[int, ...], state: Array, margin: float,
    rng: np.random.Generator, starts: int = 4,
) -> Array | None:  # fmt: skip
    """A posture from the given one on, or from others nearby."""
    held, carrying = world.contacts(contacts), world.contacts(bears)
    for attempt in range(starts):
        trial = state.copy()
        if attempt:
            middle = np.mean([world.places[at, 9:] for at in contacts if at >= 0], axis=0)
            trial[9:12] = middle + np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.3, 1.0)]) * 0.5 * world.length
            trial[:9] = (trial[:9].reshape(3, 3) @ pin.exp3(rng.uniform(-0.2, 0.2, 3))).ravel()
            trial[12:] = np.concatenate(world.limbs.rest)
        how, found, _ = world.stand(held, carrying, margin, trial, followed=False)
        ends = zip(world.offsets, world.offsets[1:], bears, strict=False)
        held_angles = [12 + k for low, high, at in ends if at >= 0 for k in range(low, high)]
        if how == PostureOutcome.STANDS and np.abs(found - state)[held_angles].max(initial=0.0) < FLIPPED:
            return found
    return None


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
