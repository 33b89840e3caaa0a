"""The plan of a body: which chains of a tree of points are legs and arms, and where its left and its front are.

The same search serves a person's skeleton, an animal's, and the joints of a robot: limbs are pairs of chains of equal
bones, the trunk lies between them, and names only decide between left and right where they say it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.errors import WbcError
from wbc.retarget.clip import Array, Skeleton, ancestors
from wbc.retarget.words import FRONT, HIND, side_of

#: Limbs by name, in the order in which they are shown
LIMBS = ("left_leg", "right_leg", "left_arm", "right_arm")
#: A pair of chains shorter than this share of the longest pair is no pair of limbs: eyes, ears, fingers
LEAST_LIMB = 0.3
#: Two chains are a pair where their bones differ by no more than this share of the chain's length
UNLIKE = 0.15
#: What the distance of two chains' first joints counts against the difference of their bones
APART = 0.2
#: What names that say left of one chain and right of the other count
NAMED = 0.3
#: A trunk whose direction has at least this part along the vertical is upright
UPRIGHT = 0.6
#: A branch of a leg that ends this share of its length below the longest one is the leg
LOWER = 0.2
#: A bone shorter than this share of its limb has no direction
SHORT = 1e-3
#: Forward, where neither names nor toes nor a head say it: along x, as in robots' descriptions
AHEAD = np.array([1.0, 0.0, 0.0])


class BodyError(WbcError):
    """A skeleton or a robot in which no limbs are found."""


@dataclass(frozen=True)
class BodyPlan:
    """Limbs, trunk and head of a skeleton.

    Attributes:
        limbs: name of :data:`LIMBS` -> points from the first below the trunk to the end.
        pelvis, chest: points that carry legs and arms; equal where one rigid body carries both.
        head: points of the chain without a partner beyond the arms, or (). axes: forward, left and up at rest, columns.
        upright: whether the trunk stands on its legs; False: it lies on four.
    """

    tree: Skeleton
    limbs: dict[str, tuple[int, ...]]
    pelvis: int
    chest: int
    head: tuple[int, ...]
    axes: Array
    upright: bool


@dataclass(frozen=True)
class _LimbPair:
    """Two chains that mirror each other, the point that carries them, and the middle of their first points [m]."""

    carrier: int
    chains: tuple[tuple[int, ...], tuple[int, ...]]
    reach: float
    middle: Array


def find_body(
    tree: Skeleton, *, field: str = "skeleton", arms: bool = False, straight: float = 1.0, up: Array | None = None
) -> BodyPlan:
    """The plan of a skeleton; :class:`BodyError` without a pair of limbs.

    Args:
        field: what a refusal names. arms: a single pair of limbs is arms, not legs.
        straight: cosine of the angle within which the line from right to left is taken for a coordinate axis.
        up: the direction that is up unless limbs say another; None: limbs alone say it.
    """
    every = _pairs(tree)
    if not every:
        raise BodyError(field, ", ".join(tree.names[:8]), "no two chains of equal bones: there are no limbs to find")
    up = _up(tree, every, np.zeros(3) if up is None else up)
    # Legs, and where there are more limbs those that carry the shoulders
    pairs = sorted(every, key=lambda pair: float(pair.middle @ up))[:: max(len(every) - 1, 1)]
    if len(every) > 2:
        # Of more than two pairs those that reach farthest up and down
        pairs[0] = min(every, key=lambda pair: np.mean([tree.rest[chain[-1]] @ up for chain in pair.chains]))
    trunk = pairs[-1].middle - pairs[0].middle
    upright = len(pairs) == 1 or bool(abs(trunk @ up) > UPRIGHT * np.linalg.norm(trunk))
    across = _across(tree, every, up, straight)
    if not upright and _fore_first(tree, pairs, up):
        pairs.reverse()
    left = _left(tree, pairs, across, up, upright)
    limbs: dict[str, tuple[int, ...]] = {}
    for kind, pair in zip(("leg", "arm"), pairs, strict=False):
        feet = kind == "leg" or not upright
        chains = [_lowest_branch(tree, chain, up) for chain in pair.chains] if feet else list(pair.chains)
        chains.sort(key=lambda chain: -float(tree.rest[list(chain)].mean(axis=0) @ left))
        kind = "arm" if arms and len(pairs) == 1 else kind
        limbs[f"left_{kind}"], limbs[f"right_{kind}"] = chains
    axes = np.stack([np.cross(left, up), left, up], axis=1)
    return BodyPlan(tree, limbs, pairs[0].carrier, pairs[-1].carrier, _head(tree, pairs, up), axes, upright)


def longest_chain(tree: Skeleton, first: int) -> tuple[int, ...]:
    """Points from one to the end of the longest branch below it."""
    below = [longest_chain(tree, child) for child in tree.children[first]]
    return (first, *max(below, key=lambda chain: tree.length((first, *chain)), default=()))


def _lowest_branch(tree: Skeleton, chain: tuple[int, ...], up: Array) -> tuple[int, ...]:
    """The branch of a leg that ends well below the longest one, else that; of several to one place the shortest."""
    ends = {k for k in range(len(tree.names)) if chain[0] in ancestors(tree.parents, k)} - {*tree.parents}
    end = min(ends, key=lambda point: (float(tree.rest[point] @ up), point))
    if float((tree.rest[chain[-1]] - tree.rest[end]) @ up) <= LOWER * tree.length(chain):
        end = chain[-1]
    same = [k for k in sorted(ends) if np.linalg.norm(tree.rest[k] - tree.rest[end]) < SHORT * tree.length(chain)]
    return min((tree.path(chain[0], k) for k in (end, *same)), key=tree.length)


def _pairs(tree: Skeleton) -> list[_LimbPair]:
    """Pairs of limbs on the trunk."""
    children = tree.children
    pairs: list[_LimbPair] = []
    waiting = [point for point, parent in enumerate(tree.parents) if parent < 0]
    while waiting:
        point = waiting.pop()
        rest = {child: longest_chain(tree, child) for child in children[point]}
        costs = sorted((*_unlike(tree, rest[a], rest[b]), a, b) for a, b in itertools.combinations(rest, 2))
        for _, bones, a, b in costs:
            if bones < UNLIKE and a in rest and b in rest:
                pair = rest.pop(a), rest.pop(b)
                middle = np.asarray(np.mean([tree.rest[a], tree.rest[b]], axis=0))
                pairs.append(_LimbPair(point, pair, min(map(tree.length, pair)), middle))
        waiting += rest
    longest = max((pair.reach for pair in pairs), default=0.0)
    return [pair for pair in pairs if pair.reach > LEAST_LIMB * longest and min(map(len, pair.chains)) >= 2]


def _unlike(tree: Skeleton, a: tuple[int, ...], b: tuple[int, ...]) -> tuple[float, float]:
    """(by which of several partners the nearest and likest comes first, how much the bones of two chains differ)."""
    first, second = tree.bones(a), tree.bones(b)
    length = max(float(first.sum()), float(second.sum()))
    if length == 0.0:
        return np.inf, np.inf
    if len(a) == len(b):
        bones = float(np.abs(first - second).sum()) / length
    else:
        bones = 0.1 + abs(float(first.sum() - second.sum())) / length
    sides = side_of(tree.names[a[0]]) * side_of(tree.names[b[0]])
    return bones + APART * tree.length((a[0], b[0])) / length + NAMED * sides, bones


def _up(tree: Skeleton, pairs: Sequence[_LimbPair], likely: Array) -> Array:
    """The coordinate axis nearest to the way up along the limbs, the likely one among them: arms may point ahead."""
    chains = np.array([(chain[0], chain[-1]) for pair in pairs for chain in pair.chains])
    rise = (tree.rest[chains[:, 0]] - tree.rest[chains[:, 1]]).sum(axis=0)
    rise += likely * max(pair.reach for pair in pairs)
    axis = int(np.argmax(np.abs(rise)))
    return np.asarray(np.eye(3)[axis] * (np.sign(rise[axis]) or 1.0))


def _across(tree: Skeleton, pairs: Sequence[_LimbPair], up: Array, straight: float) -> Array:
    """The line from right to left, of unknown sign; a coordinate axis where it is as near to one as ``straight``."""
    out = np.zeros(3)
    for pair in pairs:
        a, b = (tree.rest[list(chain)].mean(axis=0) for chain in pair.chains)
        line = a - b
        out += line if line @ out >= 0.0 else -line
    out -= (out @ up) * up
    size = float(np.linalg.norm(out))
    if size == 0.0:
        raise BodyError("skeleton", ", ".join(tree.names[:8]), "both limbs of each pair lie in one line at rest")
    axis = int(np.argmax(np.abs(out)))
    return np.eye(3)[axis] * np.sign(out[axis]) if abs(out[axis]) > straight * size else out / size


def _left(tree: Skeleton, pairs: Sequence[_LimbPair], across: Array, up: Array, upright: bool) -> Array:
    """The direction to the left; :data:`AHEAD` is forward where neither names, nor a lying trunk, nor toes say it."""
    legs, votes = pairs[0], 0.0
    for chain in [chain for pair in pairs for chain in pair.chains]:
        said = side_of(tree.names[chain[0]]) or side_of(tree.names[chain[-1]])
        votes += said * float(np.sign((tree.rest[list(chain)].mean(axis=0) - legs.middle) @ across))
    if votes:
        return np.asarray(across * np.sign(votes))
    forward = pairs[-1].middle - legs.middle if not upright else np.zeros(3)
    if upright and min(map(len, legs.chains)) >= 4:
        # Toes point forward
        for chain in legs.chains:
            forward += tree.rest[chain[-1]] - tree.rest[chain[-2]]
    ahead = np.cross(across, up)
    vote = float(forward @ ahead)
    if abs(vote) < 0.2 * float(np.linalg.norm(forward)) or vote == 0.0:
        vote = float(AHEAD @ ahead) or 1.0
    return np.asarray(across * np.sign(vote))


def _fore_first(tree: Skeleton, pairs: Sequence[_LimbPair], up: Array) -> bool:
    """Whether the first of two pairs under a lying trunk is that of the front legs."""
    first, second = (len(said & FRONT) - len(said & HIND) for said in (tree.said(pair.chains) for pair in pairs))
    if first != second:
        return first > second
    if head := _head(tree, pairs, up):
        near, far = (np.linalg.norm(tree.rest[head[-1]] - pair.middle) for pair in pairs)
        return bool(near < far)
    return float((pairs[1].middle - pairs[0].middle) @ AHEAD) < 0.0


def _head(tree: Skeleton, pairs: Sequence[_LimbPair], up: Array) -> tuple[int, ...]:
    """The chain without a partner that reaches highest, beyond the trunk."""
    no_head = {*tree.path(pairs[0].carrier, pairs[-1].carrier), *(chain[0] for pair in pairs for chain in pair.chains)}
    first = {child for pair in pairs for child in tree.children[pair.carrier]} - no_head
    chains = [longest_chain(tree, child) for child in first]
    chains = [chain for chain in chains if float((tree.rest[chain[-1]] - pairs[0].middle) @ up) > 0.0]
    return max(chains, key=lambda chain: float(tree.rest[chain[-1]] @ up), default=())
