"""Hands: fingers of a skeleton in which one body carries all of them."""

from __future__ import annotations

import itertools

import numpy as np

from wbc.retarget.body import BodyError, BodyPlan, longest_chain
from wbc.retarget.clip import Array, Skeleton
from wbc.retarget.words import LEG_WORDS, side_of

#: Fingers, of which the first and the last are at the palm's edges, and words of their names
FINGERS = {
    "index": {"index", "ff", "forefinger"}, "thumb": {"thumb", "th"}, "middle": {"middle", "mid", "mf"},
    "ring": {"ring", "rf"}, "little": {"little", "pinky", "lf"},
}  # fmt: skip
#: Joints nearer to each other than this share of their finger are one knuckle
KNUCKLE = 0.05


def find_hand(tree: Skeleton, side: int = 0) -> BodyPlan:
    """The palm, and knuckles and tip of each finger, at most four points, in the order of :data:`FINGERS`.

    The plan's axes are out of the back of a right hand, or the palm of a left one, from its last finger to the index,
    and from fingers to wrist. Of several hands it is the one whose names say the side, 1: left, -1: right;
    :class:`BodyError` where no point carries a thumb and two fingers.
    """
    chains = [[_knuckles(tree, longest_chain(tree, child)) for child in own] for own in tree.children]
    hands = [[chain for chain in own if len(chain) > 2] for own in chains]
    sides = [sum(side_of(tree.names[chain[-1]]) for chain in own) for own in hands]
    palm = max(range(len(hands)), key=lambda point: len(hands[point]) + (side * sides[point] > 0))
    found = hands[palm]
    if len(found) < 3 or tree.said(found) & LEG_WORDS:
        raise BodyError("skeleton", ", ".join(tree.names[:8]), "no hand: no point carries a thumb and two fingers")
    said = {name: [k for k, chain in enumerate(found) if own & tree.said([chain])] for name, own in FINGERS.items()}
    if sorted(k for own in said.values() for k in own) == list(range(len(found))):
        named = {name: own[0] for name, own in said.items() if own}
    else:
        # The thumb is farthest from the two fingers next to it; the others follow by their distance from it
        middles = np.array([tree.rest[list(chain)].mean(axis=0) for chain in found])
        apart = np.linalg.norm(middles[:, None] - middles, axis=2)
        thumb = int(np.sort(apart, axis=1)[:, 1:3].sum(axis=1).argmax())
        order = np.argsort(apart[thumb], kind="stable").tolist()
        named = dict(zip(("thumb", "index", "middle", "ring", "little"), order, strict=False))
    limbs = {name: found[named[name]] for name in FINGERS if name in named}
    firsts = np.array([tree.rest[chain[0]] for name, chain in limbs.items() if name != "thumb"])
    tips = np.array([tree.rest[chain[-1]] for name, chain in limbs.items() if name != "thumb"])
    across = firsts[0] - firsts[-1]
    wrist = tree.rest[palm] - firsts.mean(axis=0)
    # Where the palm is among its fingers' first joints these say where the wrist is
    wrist = wrist if np.linalg.norm(np.cross(wrist, across)) > 0.5 * across @ across else (firsts - tips).mean(axis=0)
    y = across / np.linalg.norm(across)
    x = np.cross(y, wrist)
    x /= np.linalg.norm(x)
    return BodyPlan(tree, limbs, palm, palm, (), np.stack([x, y, np.cross(x, y)], axis=1), True)


def handedness(plan: BodyPlan, points: Array) -> float:
    """1 of a right hand, -1 of a left one, by where its fingers are bent to at points [points, 3]; 0: not at all."""
    bones = [np.diff(points[list(chain[:3])], axis=0) for name, chain in plan.limbs.items() if name != "thumb"]
    return float(np.sign(sum(np.cross(first, second) @ plan.axes[:, 1] for first, second in bones)))


def _knuckles(tree: Skeleton, chain: tuple[int, ...]) -> tuple[int, ...]:
    """The last points of a finger, at most four; of several at one place the last one that turns it."""
    apart = KNUCKLE * tree.length(chain)
    kept = [point for point, after in itertools.pairwise(chain) if tree.length((point, after)) > apart]
    return (*kept, chain[-1])[-4:]
