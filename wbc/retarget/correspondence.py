"""Which points of a skeleton lead which links of a robot: found, shown, saved and read again."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.extras import require
from wbc.retarget.body import LIMBS, BodyError, BodyPlan, find_body
from wbc.retarget.clip import Array, Skeleton
from wbc.retarget.hands import FINGERS, find_hand, handedness
from wbc.retarget.robot_body import RobotBody
from wbc.retarget.words import ARM_WORDS, side_of

#: How much a limb's longer bone counts against its shorter one when knee and elbow are sought
UNEVEN = 0.5
#: Points of the trunk
TRUNK = ("pelvis", "chest", "head")


class CorrespondenceError(BodyError):
    """A skeleton that cannot lead a robot, or a file that holds no correspondence."""


@dataclass(frozen=True)
class LimbMatch:
    """Points of a skeleton that lead a limb of a robot.

    Attributes:
        source: the skeleton's limb. base, middle, end, tip: numbers of its hip, knee, ankle and toe, or of shoulder,
            elbow, wrist and finger tip; the tip is the end where the skeleton ends there.
    """

    source: str
    base: int
    middle: int
    end: int
    tip: int

    @property
    def chain(self) -> tuple[int, int, int, int]:
        """Base, middle, end and tip."""
        return self.base, self.middle, self.end, self.tip

    def length(self, points: Array) -> float:
        """Of its two bones, where the skeleton's points are there [m]."""
        return float(np.linalg.norm(np.diff(points[list(self.chain[:3])], axis=0), axis=1).sum())


@dataclass(frozen=True)
class Correspondence:
    """A skeleton beside a robot.

    Attributes:
        body: of the robot. skeleton: whose points lead it.
        limbs: robot's limb -> points that lead it. pelvis, chest, head: points of the trunk; -1 without a head.
        axes: forward, left and up of the skeleton at rest, as columns. upright: whether it stands on two legs there.
        scale: metres of the robot to one of the skeleton.
        all_fours: a person's hands and feet lead four legs; False: the feet alone, in diagonal pairs.
        mirrored: a left hand leads a right one, or a right one a left one.
        notes: what is worth knowing: what was guessed or left out.
    """

    body: RobotBody
    skeleton: Skeleton
    limbs: dict[str, LimbMatch]
    pelvis: int
    chest: int
    head: int
    axes: Array
    upright: bool
    scale: float
    all_fours: bool = False
    mirrored: bool = False
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        """A short YAML, with the robot's joints beside the points that lead them."""
        names, model = [json.dumps(n, ensure_ascii=False) for n in self.skeleton.names], self.body.robot.model
        lines = [f"robot: {self.body.robot.name}", f"scale: {self.scale:.6g}"]
        lines.append(f"all_fours: {str(self.all_fours).lower()}")
        lines += [f"{part}: {names[k]}" for part in TRUNK if (k := int(getattr(self, part))) >= 0]
        lines.append("limbs:  # base, middle, end, tip")
        for limb, match in self.limbs.items():
            mine, points = self.body.limbs[limb], ", ".join(names[k] for k in match.chain)
            frames = [model.frames[int(model.getFrameId(frame))] for frame in (mine.middle, mine.wrist) if frame]
            joints = [str(model.names[joint]) for joint in (mine.joints[0], *(frame.parentJoint for frame in frames))]
            lines.append(f"  {limb}: [{match.source}, {points}]  # {', '.join(joints)}, {mine.contact}")
        return "\n".join([*lines, *(f"# {note}" for note in self.notes)])

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write its text, which :meth:`read` takes after it was edited.

        Raises:
            CorrespondenceError: the file cannot be written.
        """
        with validation.writing("correspondence", file, CorrespondenceError), open(file, "w", encoding="utf-8") as out:
            out.write(f"{self}\n")

    def read(self, file: str | os.PathLike[str]) -> Correspondence:
        """This correspondence with what a file says in place of what was found.

        Raises:
            CorrespondenceError: no such file, or no YAML of a correspondence. UnknownNameError: a point or a limb that
                is not there. MissingPackageError: PyYAML is not installed.
        """
        require("programs", "reading a correspondence", "yaml")
        import yaml

        text = validation.text_of("correspondence", file, CorrespondenceError)
        try:
            given = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise CorrespondenceError("correspondence", str(file), f"no YAML: {error}") from None
        return self.corrected(validation.mapping("correspondence", given, "limbs, pelvis, chest, head and scale"))

    def corrected(self, given: Mapping[str, Any]) -> Correspondence:
        """This correspondence with some of its parts replaced, as the file has them.

        Raises:
            UnknownNameError: a part, a limb or a point that is not there. ShapeError, RangeError: a bad value.
        """
        names = self.skeleton.names
        changes: dict[str, Any] = {}
        for key, value in given.items():
            validation.one_of("correspondence", key, ("robot", "scale", "all_fours", *TRUNK, "limbs"))
            if key in TRUNK:
                changes[key] = names.index(validation.one_of(key, value, names))
            elif key == "scale":
                changes[key] = validation.scalar("scale", value, low=1e-3, high=1e3)
            elif key == "all_fours":
                changes[key] = validation.flag("all_fours", value)
        limbs = dict(self.limbs)
        for limb, row in validation.mapping("limbs", given.get("limbs", {}), "limbs to points").items():
            field = f"limbs.{validation.one_of('limbs', limb, self.body.limbs)}"
            points = validation.strings(field, row)
            if len(points) != 5:
                raise CorrespondenceError(field, row, "expected a limb and four points: base, middle, end, tip")
            source = validation.one_of(field, points[0], (*LIMBS, *FINGERS))
            limbs[limb] = LimbMatch(source, *(names.index(validation.one_of(field, k, names)) for k in points[1:]))
        return replace(self, limbs=limbs, **changes)


def correspondence(body: RobotBody, skeleton: Skeleton, *, all_fours: bool = False) -> Correspondence:
    """Find which points of a skeleton lead which links of a robot.

    Legs lead legs and arms lead arms. A robot on four legs that a person leads follows the feet in diagonal pairs, or
    with ``all_fours`` hands and feet. :class:`CorrespondenceError` where the skeleton lacks limbs that the robot needs.
    """
    robot, some = body.robot, ", ".join(skeleton.names[:8])
    if body.is_hand:
        plan = find_hand(skeleton, side_of(robot.name))
        limbs = {}
        for name, chain in plan.limbs.items():
            # What leads a finger of two bones goes from its middle to the tip
            three = name not in body.limbs or body.limbs[name].wrist
            limbs[name] = LimbMatch(name, chain[0], chain[1], chain[2] if three else chain[-1], chain[-1])
    else:
        plan = find_body(skeleton)
        limbs = {name: _hinges(plan, chain, name, skeleton.ends) for name, chain in plan.limbs.items()}
    if "left_arm" not in limbs and plan.tree.said([*plan.limbs.values()]) & ARM_WORDS:
        renamed = {name.replace("leg", "arm"): match for name, match in limbs.items()}
        limbs = {name: replace(match, source=name) for name, match in renamed.items()}
    if robot.base != "fixed" and "left_leg" not in limbs:
        raise CorrespondenceError("skeleton", some, f"has no legs, and {robot.name!r} stands on its own")
    pairs: dict[str, LimbMatch] = {}
    notes: list[str] = []
    for limb in body.limbs:
        source = limb
        if not body.plan.upright and plan.upright and not all_fours and limb.endswith("arm"):
            # As in a trot a front leg moves with the hind leg of the other side
            source = "right_leg" if limb.startswith("left") else "left_leg"
        if source in limbs:
            pairs[limb] = limbs[source]
        else:
            notes.append(f"{limb} has nobody to follow: the skeleton has no {source}")
    if not pairs:
        raise CorrespondenceError("skeleton", some, f"has no limb that {robot.name!r} has")
    guessed = [limb for limb, own in body.limbs.items() if own.guessed]
    notes += [f"{limb}: the size of its end is not in the robot's file and is assumed" for limb in guessed]
    mirrored = body.is_hand and handedness(plan, skeleton.rest) * handedness(body.plan, body.bent) < 0.0
    notes += ["a hand leads one of the other side: it is mirrored"] if mirrored else []
    head = plan.head[min(1, len(plan.head) - 1)] if plan.head else -1
    return Correspondence(
        body, skeleton, pairs, plan.pelvis, plan.chest, head, plan.axes, plan.upright,
        _scale(body, skeleton.rest, pairs, plan), all_fours, mirrored, tuple(notes),
    )  # fmt: skip


def _hinges(plan: BodyPlan, chain: tuple[int, ...], name: str, ends: tuple[bool, ...]) -> LimbMatch:
    """Hip, knee, ankle and toe of a chain: the three points between which its two longest and most equal bones lie."""
    tree, names = plan.tree, ", ".join(plan.tree.names[point] for point in chain)
    if len(chain) < 3:
        reason = f"the {name} has {len(chain)} points; base, middle and end are needed"
        raise CorrespondenceError("skeleton", names, reason)
    bones = tree.bones(chain)
    best, places = -np.inf, (0, 1, 2)
    for a, b, c in itertools.combinations(range(len(chain)), 3):
        upper, lower = (tree.length((chain[i], chain[j])) for i, j in ((a, b), (b, c)))
        # A point left out costs the shorter of its bones: little of a clavicle or a toe, much of an elbow
        left_out = sum(min(bones[k - 1], bones[k]) for k in range(a + 1, c) if k != b)
        # The end of a bone is no joint
        score = min(upper, lower) - UNEVEN * abs(upper - lower) - left_out - 0.5 * bones[c - 1] * ends[chain[c]]
        if score > best:
            best, places = score, (a, b, c)
    if best <= 0.0:
        raise CorrespondenceError("skeleton", names, f"the bones of the {name} have no length")
    base, middle, end = (chain[k] for k in places)
    return LimbMatch(name, base, middle, end, chain[-1])


def _scale(body: RobotBody, rest: Array, pairs: Mapping[str, LimbMatch], plan: BodyPlan) -> float:
    """Metres of the robot to one of the skeleton: of the legs' lengths, or of the heights of backs on four legs."""
    kind = "leg" if "left_leg" in pairs else "arm"
    sides = [name for name in (f"left_{kind}", f"right_{kind}") if name in pairs] or list(pairs)
    theirs = float(np.mean([pairs[name].length(rest) for name in sides]))
    if body.plan.upright:
        return float(np.mean([sum(body.limbs[name].lengths) for name in sides])) / theirs
    if not plan.upright:
        # A leg of an animal has more bones than two
        up = plan.axes[:, 2]
        theirs = float(np.mean([(rest[pairs[name].base] - rest[pairs[name].tip]) @ up for name in sides]))
    radius = float(np.mean([body.limbs[name].radius for name in sides]))
    return (body.height - radius) / theirs
