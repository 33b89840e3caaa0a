"""The plan of a body: which chains of a tree of points are legs and arms, and where its left and its front are.

The same search serves a person's skeleton, an animal's, and the joints of a robot: limbs are pairs of chains of equal
bones, the trunk lies between them, and names only decide between left and right where they say it.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.errors import WbcError
from wbc.retarget.clip import Array

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

_LEFT = {"left", "l", "fl", "hl", "rl", "bl", "lf", "lh", "lb"}
_RIGHT = {"right", "r", "fr", "hr", "rr", "br", "rf", "rh", "rb"}
_FRONT = {"front", "fore", "fl", "fr", "lf", "rf", "arm", "hand", "shoulder"}
_HIND = {"hind", "rear", "back", "hl", "hr", "rl", "rr", "bl", "br", "lh", "rh", "leg", "hip", "foot"}
#: Words of a single pair of limbs that say which it is
ARM_WORDS = {"arm", "hand", "wrist", "elbow", "shoulder", "forearm", "gripper"}
LEG_WORDS = {"leg", "hip", "knee", "ankle", "foot", "toe", "thigh", "shin"}
_PARTS = {"leg", "arm", "hip", "knee", "ankle", "foot", "toe", "thigh", "shin", "shoulder", "elbow", "wrist", "hand"}


class BodyError(WbcError):
    """A skeleton or a robot in which no limbs are found."""


@dataclass(frozen=True)
class PointTree:
    """Points at rest as a tree, parents first.

    Attributes:
        names: of the points. parents: number of each one's parent; -1 at the root.
        points: positions at rest [points, 3] [m].
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    points: Array

    def children(self) -> list[list[int]]:
        """Numbers of each point's children."""
        found: list[list[int]] = [[] for _ in self.names]
        for child, parent in enumerate(self.parents):
            if parent >= 0:
                found[parent].append(child)
        return found

    def path(self, start: int, end: int) -> tuple[int, ...]:
        """Points from one to another along the tree, both included."""
        up, down = self._ancestors(start), self._ancestors(end)
        meeting = next(point for point in up if point in down)
        return (*up[: up.index(meeting) + 1], *reversed(down[: down.index(meeting)]))

    def _ancestors(self, point: int) -> list[int]:
        chain = [point]
        while self.parents[chain[-1]] >= 0:
            chain.append(self.parents[chain[-1]])
        return chain


@dataclass(frozen=True)
class BodyPlan:
    """Limbs, trunk and head of a tree of points.

    Attributes:
        tree: the points. limbs: name of :data:`LIMBS` -> points from the first below the trunk to the end.
        pelvis, chest: points that carry legs and arms; equal where one rigid body carries both.
        head: points of the chain without a partner beyond the arms, or ().
        axes: forward, left and up of the rest pose, as columns [3, 3].
        upright: whether the trunk stands on its legs; False: it lies on four.
    """

    tree: PointTree
    limbs: dict[str, tuple[int, ...]]
    pelvis: int
    chest: int
    head: tuple[int, ...]
    axes: Array
    upright: bool


@dataclass(frozen=True)
class _LimbPair:
    """Two chains that mirror each other, and the point that carries them."""

    carrier: int
    chains: tuple[tuple[int, ...], tuple[int, ...]]
    reach: float


def words(name: str) -> list[str]:
    """Words of a name in lower case: of camel case, underscores, dots and blanks."""
    spaced = re.sub(r"([a-z])([A-Z])|([A-Z])([A-Z][a-z])", r"\1\3 \2\4", name)
    return [word for word in re.split(r"[^a-z]+", spaced.lower()) if word]


def side_of(name: str) -> int:
    """1 of a name that says left, -1 of one that says right, else 0; the first word that says it counts."""
    for word in words(name):
        part = word[1:] if word[:1] in "lr" and word[1:] in _PARTS else ""
        if word in _LEFT or (part and word[0] == "l"):
            return 1
        if word in _RIGHT or (part and word[0] == "r"):
            return -1
    return 0


def find_body(
    tree: PointTree,
    *,
    field: str = "skeleton",
    arms: bool = False,
    straight: float = 1.0,
) -> BodyPlan:
    """The plan of a tree of points.

    Args:
        field: what a refusal names. arms: a single pair of limbs is arms, not legs.
        straight: cosine of the angle within which the line from right to left is taken for a coordinate axis.

    Raises:
        BodyError: no pair of limbs.
    """
    pairs = _pairs(tree)
    if not pairs:
        raise BodyError(field, ", ".join(tree.names[:8]), "no two chains of equal bones: there are no limbs to find")
    up = _up(tree, pairs)
    # Where neither names nor toes nor a head say it the front is along x, as in robots' descriptions
    hint = np.array([1.0, 0.0, 0.0])
    middles = [_middle(tree, pair) for pair in pairs]
    if len(pairs) == 1:
        legs, fore, upright = pairs[0], None, True
    else:
        order = np.argsort([float(middle @ up) for middle in middles])
        low, high = pairs[order[0]], pairs[order[-1]]
        if len(pairs) > 2:
            # Of more than two pairs those that reach farthest up and down
            ends = [float(np.mean([tree.points[chain[-1]] @ up for chain in pair.chains])) for pair in pairs]
            low = pairs[int(np.argmin(ends))]
        trunk = _middle(tree, high) - _middle(tree, low)
        upright = bool(abs(trunk @ up) > UPRIGHT * np.linalg.norm(trunk))
        legs, fore = low, high
    across = _across(tree, pairs, up, straight)
    if not upright and fore is not None:
        legs, fore = _hind_and_fore(tree, (legs, fore), up, across, hint)
    left = _left(tree, (legs, fore), across, up, hint, upright)
    limbs: dict[str, tuple[int, ...]] = {}
    for kind, pair in (("leg", legs), ("arm", fore)):
        if pair is None:
            continue
        feet = kind == "leg" or not upright
        branches = [_lowest_branch(tree, chain, up) for chain in pair.chains] if feet else list(pair.chains)
        chains = sorted(branches, key=lambda chain: -float(tree.points[chain[0]] @ left))
        if abs(float((tree.points[chains[0][0]] - tree.points[chains[1][0]]) @ left)) < SHORT * pair.reach:
            chains = sorted(branches, key=lambda chain: -float(tree.points[chain[-1]] @ left))
        limbs[f"left_{kind}"], limbs[f"right_{kind}"] = chains
    if arms and fore is None:
        limbs = {name.replace("leg", "arm"): chain for name, chain in limbs.items()}
    chest = legs.carrier if fore is None else fore.carrier
    axes = np.stack([np.cross(left, up), left, up], axis=1)
    return BodyPlan(tree, limbs, legs.carrier, chest, _head(tree, legs, fore, up), axes, upright)


def longest_chain(tree: PointTree, first: int) -> tuple[int, ...]:
    """Points from one to the end of the longest branch below it."""
    children, reach = tree.children(), _reaches(tree)
    chain = [first]
    while children[chain[-1]]:
        here = chain[-1]
        chain.append(max(children[here], key=lambda child: reach[child] + _bone(tree, child)))
    return tuple(chain)


def _lowest_branch(tree: PointTree, chain: tuple[int, ...], up: Array) -> tuple[int, ...]:
    """The branch of a leg that ends lowest, where that is well below the longest branch's end; else the longest."""
    children = tree.children()
    below, waiting = [], [chain[0]]
    while waiting:
        point = waiting.pop()
        below.append(point)
        waiting += children[point]
    lowest = min((point for point in below if not children[point]), key=lambda point: float(tree.points[point] @ up))
    if float((tree.points[chain[-1]] - tree.points[lowest]) @ up) > LOWER * _length(tree, chain):
        return tree.path(chain[0], lowest)
    return chain


def _bone(tree: PointTree, point: int) -> float:
    parent = tree.parents[point]
    return float(np.linalg.norm(tree.points[point] - tree.points[parent])) if parent >= 0 else 0.0


def _reaches(tree: PointTree) -> Array:
    """Length of the longest branch below each point."""
    reach = np.zeros(len(tree.names))
    for point in range(len(tree.names) - 1, 0, -1):
        parent = tree.parents[point]
        if parent >= 0:
            reach[parent] = max(reach[parent], reach[point] + _bone(tree, point))
    return reach


def _pairs(tree: PointTree) -> list[_LimbPair]:
    """Pairs of limbs on the trunk."""
    children = tree.children()
    found: list[_LimbPair] = []
    waiting = [point for point, parent in enumerate(tree.parents) if parent < 0]
    while waiting:
        point = waiting.pop()
        rest = {child: longest_chain(tree, child) for child in children[point]}
        costs = sorted((*_unlike(tree, rest[a], rest[b]), a, b) for a, b in itertools.combinations(rest, 2))
        for _, bones, a, b in costs:
            if bones < UNLIKE and a in rest and b in rest:
                pair = rest.pop(a), rest.pop(b)
                found.append(_LimbPair(point, pair, min(_length(tree, chain) for chain in pair)))
        waiting += rest
    longest = max((pair.reach for pair in found), default=0.0)
    return [pair for pair in found if pair.reach > LEAST_LIMB * longest and min(map(len, pair.chains)) >= 2]


def _length(tree: PointTree, chain: Sequence[int]) -> float:
    return float(np.linalg.norm(np.diff(tree.points[list(chain)], axis=0), axis=1).sum())


def _unlike(tree: PointTree, a: tuple[int, ...], b: tuple[int, ...]) -> tuple[float, float]:
    """(by which of several partners the nearest and likest comes first, how much the bones of two chains differ)."""
    profiles = [np.linalg.norm(np.diff(tree.points[list(chain)], axis=0), axis=1) for chain in (a, b)]
    length = max(float(profile.sum()) for profile in profiles)
    if length == 0.0:
        return np.inf, np.inf
    if len(a) == len(b):
        bones = float(np.abs(profiles[0] - profiles[1]).sum()) / length
    else:
        bones = 0.1 + abs(float(profiles[0].sum() - profiles[1].sum())) / length
    sides = side_of(tree.names[a[0]]) * side_of(tree.names[b[0]])
    distance = float(np.linalg.norm(tree.points[a[0]] - tree.points[b[0]])) / length
    return bones + APART * distance + NAMED * sides, bones


def _middle(tree: PointTree, pair: _LimbPair) -> Array:
    return np.asarray(np.mean([tree.points[chain[0]] for chain in pair.chains], axis=0))


def _up(tree: PointTree, pairs: Sequence[_LimbPair]) -> Array:
    """The coordinate axis that is nearest to the direction from the limbs' ends to their beginnings."""
    rise = np.zeros(3)
    for pair in pairs:
        for chain in pair.chains:
            rise += tree.points[chain[0]] - tree.points[chain[-1]]
    axis = int(np.argmax(np.abs(rise)))
    up = np.zeros(3)
    up[axis] = np.sign(rise[axis]) or 1.0
    return up


def _across(tree: PointTree, pairs: Sequence[_LimbPair], up: Array, straight: float) -> Array:
    """The line from right to left, of unknown sign; a coordinate axis where it is as near to one as ``straight``."""
    out = np.zeros(3)
    for pair in pairs:
        a, b = (tree.points[list(chain)].mean(axis=0) for chain in pair.chains)
        line = a - b
        out += line if line @ out >= 0.0 else -line
    out -= (out @ up) * up
    size = float(np.linalg.norm(out))
    if size == 0.0:
        raise BodyError("skeleton", ", ".join(tree.names[:8]), "both limbs of each pair lie in one line at rest")
    axis = int(np.argmax(np.abs(out)))
    snapped = np.zeros(3)
    snapped[axis] = np.sign(out[axis])
    return snapped if abs(out[axis]) > straight * size else out / size


def _left(
    tree: PointTree, pairs: tuple[_LimbPair, _LimbPair | None], across: Array, up: Array, hint: Array, upright: bool
) -> Array:
    """The direction to the left; ``hint`` is forward where neither names, nor a lying trunk, nor toes say it."""
    legs, fore = pairs
    votes = 0.0
    for pair in (legs, fore):
        for chain in pair.chains if pair is not None else ():
            said = side_of(tree.names[chain[0]]) or side_of(tree.names[chain[-1]])
            votes += said * float(np.sign((tree.points[list(chain)].mean(axis=0) - _middle(tree, legs)) @ across))
    if votes:
        return np.asarray(across * np.sign(votes))
    forward = np.zeros(3)
    if not upright and fore is not None:
        forward = _middle(tree, fore) - _middle(tree, legs)
    elif min(map(len, legs.chains)) >= 4:
        # Toes point forward
        for chain in legs.chains:
            toe = tree.points[chain[-1]] - tree.points[chain[-2]]
            before = tree.points[chain[-2]] - tree.points[chain[-3]]
            forward += toe + (before if abs(before @ up) < 0.5 * np.linalg.norm(before) else 0.0)
    ahead = np.cross(across, up)
    vote = float(forward @ ahead)
    if abs(vote) < 0.2 * float(np.linalg.norm(forward)) or vote == 0.0:
        vote = float(hint @ ahead) or 1.0
    return np.asarray(across * np.sign(vote))


def _hind_and_fore(
    tree: PointTree, pairs: tuple[_LimbPair, _LimbPair], up: Array, across: Array, hint: Array
) -> tuple[_LimbPair, _LimbPair]:
    """Of two pairs under a lying trunk the hind legs and the front legs."""
    a, b = pairs

    def front(pair: _LimbPair) -> int:
        said = {word for chain in pair.chains for point in chain for word in words(tree.names[point])}
        return len(said & _FRONT) - len(said & _HIND)

    if front(a) != front(b):
        return (b, a) if front(a) > front(b) else (a, b)
    head = _head(tree, a, b, up)
    if head:
        end = tree.points[head[-1]]
        nearer = np.linalg.norm(end - _middle(tree, a)) < np.linalg.norm(end - _middle(tree, b))
        return (b, a) if nearer else (a, b)
    return (a, b) if float((_middle(tree, b) - _middle(tree, a)) @ hint) >= 0.0 else (b, a)


def _head(tree: PointTree, legs: _LimbPair, fore: _LimbPair | None, up: Array) -> tuple[int, ...]:
    """The chain without a partner that reaches highest, beyond the trunk."""
    carriers = {legs.carrier} | ({fore.carrier} if fore is not None else set())
    limbs = {chain[0] for pair in (legs, fore) if pair is not None for chain in pair.chains}
    trunk = set(tree.path(legs.carrier, fore.carrier)) if fore is not None else {legs.carrier}
    chains = [
        longest_chain(tree, child)
        for carrier in carriers
        for child in tree.children()[carrier]
        if child not in limbs and child not in trunk
    ]
    chains = [chain for chain in chains if float((tree.points[chain[-1]] - _middle(tree, legs)) @ up) > 0.0]
    return max(chains, key=lambda chain: float(tree.points[chain[-1]] @ up), default=())
