"""Which points of a skeleton lead which links of a robot: found, shown, saved and read again."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.extras import require
from wbc.retarget.body import ARM_WORDS, LIMBS, BodyError, BodyPlan, PointTree, find_body, words
from wbc.retarget.clip import Array, Skeleton
from wbc.retarget.robot_body import RobotBody
from wbc.robot import Robot

#: How much a limb's longer bone counts against its shorter one when knee and elbow are sought
UNEVEN = 0.5


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


@dataclass(frozen=True)
class Correspondence:
    """A skeleton beside a robot.

    Attributes:
        body: of the robot. skeleton: whose points lead it. rest: its points at rest [joints, 3] [m].
        limbs: robot's limb -> points that lead it. pelvis, chest, head: points of the trunk; -1 without a head.
        axes: forward, left and up of the skeleton at rest, as columns. upright: whether it stands on two legs there.
        scale: metres of the robot to one of the skeleton.
        all_fours: a person's hands and feet lead four legs; False: the feet alone, in diagonal pairs.
        notes: what is worth knowing: what was guessed or left out.
    """

    body: RobotBody
    skeleton: Skeleton
    rest: Array
    limbs: dict[str, LimbMatch]
    pelvis: int
    chest: int
    head: int
    axes: Array
    upright: bool
    scale: float
    all_fours: bool = False
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        names, robot = self.skeleton.names, self.body.robot
        rows = [("", *(part for part in ("base", "middle", "end", "tip")))]
        for limb, match in self.limbs.items():
            mine = self.body.limbs[limb]
            first = str(robot.model.names[mine.joints[0]])
            hinges = [_joint_of(robot, frame) if frame else "contact" for frame in (mine.middle, mine.wrist)]
            rows.append((f"{limb} of {robot.name}", first, *hinges, mine.contact))
            rows.append((f"  {match.source}", *(names[k] for k in (match.base, match.middle, match.end, match.tip))))
        widths = [max(len(row[k]) for row in rows) for k in range(5)]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        trunk = f"pelvis {names[self.pelvis]}, chest {names[self.chest]}"
        lines.append(f"{trunk}{f', head {names[self.head]}' if self.head >= 0 else ''}; scale {self.scale:.3f}")
        return "\n".join([*lines, *self.notes])

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write it as a short YAML, which :meth:`read` takes after it was edited.

        Raises:
            CorrespondenceError: the file cannot be written.
        """
        names = self.skeleton.names
        lines = [f"robot: {self.body.robot.name}", f"scale: {self.scale:.6g}"]
        lines.append(f"all_fours: {str(self.all_fours).lower()}")
        lines += [f"pelvis: {_quoted(names[self.pelvis])}", f"chest: {_quoted(names[self.chest])}"]
        if self.head >= 0:
            lines.append(f"head: {_quoted(names[self.head])}")
        lines.append("limbs:  # base, middle, end, tip")
        for limb, match in self.limbs.items():
            points = ", ".join(_quoted(names[k]) for k in (match.base, match.middle, match.end, match.tip))
            lines.append(f"  {limb}: [{match.source}, {points}]")
        with validation.writing("correspondence", file, CorrespondenceError), open(file, "w", encoding="utf-8") as out:
            out.write("\n".join(lines) + "\n")

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
            validation.one_of(
                "correspondence", key, ("robot", "scale", "all_fours", "pelvis", "chest", "head", "limbs")
            )
            if key in ("pelvis", "chest", "head"):
                changes[key] = names.index(validation.one_of(key, value, names))
            elif key == "scale":
                changes[key] = validation.scalar("scale", value, low=1e-3, high=1e3)
            elif key == "all_fours":
                changes[key] = validation.flag("all_fours", value)
        limbs = dict(self.limbs)
        for limb, row in validation.mapping("limbs", given.get("limbs", {}), "limbs to points").items():
            validation.one_of("limbs", limb, self.body.limbs)
            points = validation.strings(f"limbs.{limb}", row)
            if len(points) != 5:
                raise CorrespondenceError(
                    f"limbs.{limb}", row, "expected a limb and four points: base, middle, end, tip"
                )
            source = validation.one_of(f"limbs.{limb}", points[0], LIMBS)
            limbs[limb] = LimbMatch(
                source, *(names.index(validation.one_of(f"limbs.{limb}", point, names)) for point in points[1:])
            )
        return replace(self, limbs=limbs, **changes)


def _joint_of(robot: Robot, frame: str) -> str:
    """Name of the joint that carries a frame."""
    model = robot.model
    return str(model.names[int(model.frames[int(model.getFrameId(frame))].parentJoint)])


def _quoted(name: str) -> str:
    return "'" + name.replace("'", "''") + "'"


def rest_of(skeleton: Skeleton) -> Array:
    """Points of a skeleton at rest [joints, 3] [m]."""
    points = np.array(skeleton.offsets, dtype=float)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            points[joint] += points[parent]
    return points


def correspondence(body: RobotBody, skeleton: Skeleton, *, all_fours: bool = False) -> Correspondence:
    """Find which points of a skeleton lead which links of a robot.

    Legs lead legs and arms lead arms. A robot on four legs that a person leads follows the feet in diagonal pairs, or
    with ``all_fours`` hands and feet.

    Raises:
        CorrespondenceError: no limbs in the skeleton, or none that the robot needs: a robot that walks needs legs.
    """
    rest = rest_of(skeleton)
    plan = find_body(PointTree(skeleton.names, skeleton.parents, rest))
    limbs = {name: _hinges(plan, chain, name, skeleton.ends) for name, chain in plan.limbs.items()}
    if "left_arm" not in limbs:
        said = {word for chain in plan.limbs.values() for point in chain for word in words(skeleton.names[point])}
        if said & ARM_WORDS:
            limbs = {
                name.replace("leg", "arm"): replace(m, source=m.source.replace("leg", "arm"))
                for name, m in limbs.items()
            }
    moves = body.robot.base != "fixed"
    if moves and "left_leg" not in limbs:
        names = ", ".join(skeleton.names[:8])
        raise CorrespondenceError("skeleton", names, f"has no legs, and {body.robot.name!r} stands on its own")
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
        raise CorrespondenceError(
            "skeleton", ", ".join(skeleton.names[:8]), f"has no limb that {body.robot.name!r} has"
        )
    notes += [
        f"{limb}: the size of its end is not in the robot's file and is assumed"
        for limb, m in body.limbs.items()
        if m.guessed
    ]
    head = plan.head[min(1, len(plan.head) - 1)] if plan.head else -1
    scale = _scale(body, rest, pairs, plan)
    return Correspondence(
        body, skeleton, rest, pairs, plan.pelvis, plan.chest, head, plan.axes, plan.upright, scale, all_fours,
        tuple(notes),
    )  # fmt: skip


def _hinges(plan: BodyPlan, chain: tuple[int, ...], name: str, ends: tuple[bool, ...]) -> LimbMatch:
    """Hip, knee, ankle and toe of a chain: the three points between which its two longest and most equal bones lie."""
    points = plan.tree.points[list(chain)]
    if len(chain) < 3:
        names = ", ".join(plan.tree.names[point] for point in chain)
        raise CorrespondenceError(
            "skeleton", names, f"the {name} has {len(chain)} points; base, middle and end are needed"
        )
    bones = np.linalg.norm(np.diff(points, axis=0), axis=1)
    best, places = -np.inf, (0, 1, 2)
    for a in range(len(chain) - 2):
        for b in range(a + 1, len(chain) - 1):
            for c in range(b + 1, len(chain)):
                upper, lower = (float(np.linalg.norm(points[j] - points[i])) for i, j in ((a, b), (b, c)))
                # A point left out costs the shorter of its bones: little of a clavicle or a toe, much of an elbow
                left_out = sum(min(bones[k - 1], bones[k]) for k in range(a + 1, c) if k != b)
                score = min(upper, lower) - UNEVEN * abs(upper - lower) - left_out
                # The end of a bone is no joint
                score -= 0.5 * bones[c - 1] * ends[chain[c]]
                if score > best:
                    best, places = score, (a, b, c)
    if best <= 0.0:
        names = ", ".join(plan.tree.names[point] for point in chain)
        raise CorrespondenceError("skeleton", names, f"the bones of the {name} have no length")
    a, b, c = places
    return LimbMatch(name, chain[a], chain[b], chain[c], chain[-1])


def _length(points: Array, match: LimbMatch) -> float:
    """Length of the two bones of a limb [m]."""
    return float(np.linalg.norm(np.diff(points[[match.base, match.middle, match.end]], axis=0), axis=1).sum())


def _scale(body: RobotBody, rest: Array, pairs: Mapping[str, LimbMatch], plan: BodyPlan) -> float:
    """Metres of the robot to one of the skeleton: of the legs' lengths, or of the heights of backs on four legs."""
    kind = "leg" if "left_leg" in pairs else "arm"
    sides = [name for name in (f"left_{kind}", f"right_{kind}") if name in pairs]
    theirs = float(np.mean([_length(rest, pairs[name]) for name in sides]))
    if body.plan.upright:
        return float(np.mean([sum(body.limbs[name].lengths) for name in sides])) / theirs
    if not plan.upright:
        # A leg of an animal has more bones than two
        up = plan.axes[:, 2]
        theirs = float(np.mean([(rest[pairs[name].base] - rest[pairs[name].tip]) @ up for name in sides]))
    radius = float(np.mean([body.limbs[name].radius for name in sides]))
    return (body.height - radius) / theirs
