"""Few stones in reach of a robot, and a search over all stances on them that takes its time."""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

from wbc.climb.climber import Climber
from wbc.climb.first import first_stance
from wbc.climb.scene import ClimbScene, Foothold
from wbc.climb.search import StanceOptions
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.world import ClimbWorld, PostureOutcome
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
