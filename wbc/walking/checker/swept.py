"""Clearances as a proof: bodies over the whole motion between ticks, by :mod:`wbc.clearance`.

A hand may be nearer than the clearance to what a hold is mounted on from where it comes near to that hold, on which the
log has it then, to where it is no longer near, and no deeper in it than a stated depth beyond its own roundness. A hold
that vanishes while a hand comes to it counts as the hand's until the hand comes no nearer: no hand stops at once.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from wbc.clearance import EndlessCylinder, Exemption, Motion, Pair, Sweeper, SweptBody, SweptScene, Tree
from wbc.multibody import pin
from wbc.shapes import Capsule, HalfSpace
from wbc.validation import Array
from wbc.walking.checker.report import Tally
from wbc.walking.checker.rules import Rules
from wbc.walking.checker.samples import blocks
from wbc.walking.checker.urdf import CapsuleOfLink, Urdf, forward
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import PlaneSurface
from wbc.walking.log.log import WalkLog

LINKS, STRUCTURE = "swept clearance of links", "swept clearance of the structure"
#: A hold is mounted on what is this near to it [m]
MOUNTED = 0.005


def declare(tally: Tally, rules: Rules) -> None:
    """The checks of this module."""
    for kind in (LINKS, STRUCTURE):
        tally.declare(kind, rules.clearance - rules.clearance_slack, "m", least=True)


def check_swept(
    log: WalkLog, urdf: Urdf, file: str | os.PathLike[str], structure: Structure | None, rules: Rules, tally: Tally
) -> None:
    """Links against each other, surface and obstacles: of each pair the least distance found, or what is proven.

    The body is where the log has it; joints change evenly between ticks. Where time does not rise there is no motion.
    """
    if len(log) < 2 or not (np.diff(log.t) > 0.0).all():
        return
    tree = Tree.of_model(pin.buildModelFromUrdf(str(file)), floating=True)
    bodies = _links(log, urdf, tree)
    things = [] if structure is None else _things(structure)
    tolerance = rules.clearance_slack / 2.0
    # What is not found below this is proven to be above the limit
    required = rules.clearance - tolerance
    exempt = urdf.neighbours()
    pairs = [
        Pair(a.name, b.name, required)
        for a, b in combinations(bodies, 2)
        if b.link not in urdf.carried_with(a.link) and frozenset((a.link, b.link)) not in exempt
    ]
    own = len(pairs)
    pairs += [Pair(a.name, b.name, required) for a in bodies for b in things]
    columns = [log.joints.index(name) for name in tree.coordinates]
    motion = Motion.linear(tree, log.t, log.q[:, columns], log.pose_body_in_structure)
    exemptions = [] if structure is None else list(_exemptions(log, urdf, bodies, structure, rules))
    sweeper = Sweeper(SweptScene(tree, [*bodies, *things], pairs))
    swept = sweeper.sweep(motion, exemptions=exemptions, aim="every", tolerance=max(tolerance, 1e-6))
    least = np.maximum(swept.bound, -tolerance) + required
    for k in np.flatnonzero(swept.found < 0.0):
        # The distance itself: the margin of a hand that is too deep is what it lacks of that depth
        least[k] = sweeper.at(motion, float(swept.times[k]), [int(k)])[0].distance
    for kind, part in ((LINKS, slice(0, own)), (STRUCTURE, slice(own, None))):
        some = pairs[part]

        def where(k: int, some: Sequence[Pair] = some) -> str:
            return f"{some[k].first} and {some[k].second}"

        tally.add(kind, least[part] + 1e-12, swept.times[part], where)


def _links(log: WalkLog, urdf: Urdf, tree: Tree) -> list[SweptBody]:
    """Capsules of the links; what moves with a hand's frame has its grasp point."""
    carried = {link: hand for hand in log.hands for link in urdf.carried_with(hand)}
    out, count = list[SweptBody](), dict[str, int]()
    for capsule in urdf.capsules:
        link = capsule.link
        count[link] = count.get(link, 0) + 1
        name = link if count[link] == 1 else f"{link}, body {count[link]}"
        grasp = None
        if link in carried:
            grasp = (tree.links[link][1].inverse() * tree.links[carried[link]][1]).translation
        out.append(SweptBody(name, *_capsule(capsule), grasp=grasp))
    return out


def _capsule(capsule: CapsuleOfLink) -> tuple[Capsule, str, pin.SE3]:
    span = capsule.b - capsule.a
    length = float(np.linalg.norm(span))
    turn = np.eye(3)
    if length > 0.0:
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), span / length).matrix()
    return Capsule(capsule.radius, length), capsule.link, pin.SE3(turn, (capsule.a + capsule.b) / 2.0)


def _things(structure: Structure) -> list[SweptBody]:
    out = [SweptBody(f"obstacle {one.id}", one.shape, placement=one.placement) for one in structure.obstacles]
    surface = structure.surface
    if surface is not None:
        shape = HalfSpace() if isinstance(surface, PlaneSurface) else EndlessCylinder(surface.radius)
        out.append(SweptBody("surface", shape, placement=surface.pose))
    return out


def _exemptions(
    log: WalkLog, urdf: Urdf, bodies: Sequence[SweptBody], structure: Structure, rules: Rules
) -> Iterator[Exemption]:
    places = _places(log, urdf)
    for arm, hand in enumerate(log.hands):
        mine = [body for body in bodies if body.link in urdf.carried_with(hand)]
        rows = log.hand_hold[:, arm]
        starts = np.flatnonzero(np.diff(rows, prepend=-2))
        ends = np.append(starts[1:], len(rows)) - 1
        for start, end in zip(starts, ends, strict=True):
            if rows[start] < 0:
                continue
            point = log.hold_pose[int(rows[start]), :3]
            # From where the hand came near to where it is no longer
            gaps = np.linalg.norm(places[:, arm] - point, axis=1)
            far = np.flatnonzero(gaps > rules.exempt_distance)
            came, went = far[far < start], far[far > _left(log, int(rows[start]), int(end), gaps)]
            since = float(log.t[came[-1]] if len(came) else log.t[0])
            until = float(log.t[went[0]] if len(went) else log.t[-1])
            mounts = _mounts(structure, point)
            for body in mine:
                depth = rules.exempt_depth + float(getattr(body.shape, "radius", 0.0))
                for mount in mounts:
                    yield Exemption(body.name, mount, point, rules.exempt_distance, depth, since, until)


def _left(log: WalkLog, hold: int, end: int, gaps: Array) -> int:
    """The last row in which a hold is the one that a hand goes to, which the log has it at up to the row ``end``: of a
    hold that vanishes then the one in which the hand, whose distances [m] are given, comes no nearer.
    """
    if end + 1 >= len(log) or log.present(hold, log.t[end + 1]):
        return end
    farther = np.flatnonzero(np.diff(gaps[end:]) >= 0.0)
    return end + int(farther[0]) if len(farther) else len(log) - 1


def _places(log: WalkLog, urdf: Urdf) -> Array:
    """Where the hands are at ticks, the body as logged ``[n, a, 3]`` [m]."""
    out = np.empty((len(log), len(log.hands), 3))
    for block in blocks(log, 0):
        found = forward(urdf, log.joints, block.q)
        for arm, hand in enumerate(log.hands):
            out[block.tick, arm] = np.einsum("nij,nj->ni", block.rotation, found.position[hand]) + block.position
    return out


def _mounts(structure: Structure, point: Array) -> list[str]:
    """What a hold is mounted on; where bars meet, each of them."""
    off = {f"obstacle {one.id}": abs(float(one.distance(point))) for one in structure.obstacles}
    if structure.surface is not None:
        off["surface"] = abs(float(structure.surface.height(point)))
    return [name for name, distance in off.items() if distance <= MOUNTED]
