"""Random URDF texts with what they mean, read by nobody: poses of links, masses, limits, couplings, what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

SINGLE = ("revolute", "continuous", "prismatic")
#: Joints that have both limits of position
ENDED = ("revolute", "prismatic")
#: Faults that a reader must refuse, and those that it must say
REFUSED = ("zero axis", "two parents", "lost links", "negative mass", "mimic of planar", "circle of mimics")
SAID = (
    "swapped limits", "negative effort", "negative velocity", "limits of continuous", "bad inertia", "mimic of fixed",
    "mimic of nothing", "loose joint",
)  # fmt: skip
ODD_XML = ("", "blank lines", "prefix", "namespace", "ampersands", "dashes", "latin-1", "doctype", "mark", "no spaces")


@dataclass
class Joint:
    """A joint as its element says."""

    name: str
    kind: str
    parent: int
    child: int
    xyz: np.ndarray
    rpy: np.ndarray
    axis: np.ndarray | None
    limits: dict[str, float] = field(default_factory=dict)
    mimic: tuple[str, float, float] | None = None


@dataclass
class Link:
    """A link as its element says; moments about its centre, in axes of ``rpy``."""

    name: str
    mass: float
    xyz: np.ndarray
    rpy: np.ndarray
    inertia: np.ndarray


class RandomUrdf:
    """A tree of up to nine links; ``faults``: what is wrong with it -> words that must be said about it."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        count = int(rng.integers(3, 10))
        self.links = [self._link(k) for k in range(count)]
        self.joints: list[Joint] = []
        for child in range(1, count):
            parent = int(rng.integers(max(0, child - 3), child))
            kinds = [*SINGLE, "fixed"] if child > 1 else [*SINGLE, "floating", "planar", "fixed"]
            self.joints.append(self._joint(f"joint {child}", str(rng.choice(kinds)), parent, child))
        self.faults: dict[str, list[str]] = {}
        self._couple()
        for fault in rng.permutation([*REFUSED, *SAID])[: rng.choice(3)]:
            words = getattr(self, "_" + str(fault).replace(" ", "_").replace("-", "_"))()
            if words:
                self.faults[str(fault)] = words
        self.odd = str(rng.choice(ODD_XML))

    def _link(self, k: int) -> Link:
        rng = self.rng
        part = rng.uniform(0.1, 1.0, 3)  # integrals of x^2, y^2, z^2
        turn = pin.exp3(rng.normal(size=3))
        inertia = turn @ np.diag(part.sum() - part) @ turn.T
        return Link(f"Link {k}", float(rng.uniform(0.1, 2.0)), rng.normal(size=3), rng.normal(size=3), inertia)

    def _joint(self, name: str, kind: str, parent: int, child: int) -> Joint:
        rng = self.rng
        axis = rng.normal(size=3) if rng.random() < 0.7 else np.eye(3)[rng.integers(3)] * rng.choice([1.0, -2.0])
        if kind in (*SINGLE, "planar") and rng.random() < 0.1:
            axis = None
        out = Joint(name, kind, parent, child, rng.normal(size=3), rng.normal(size=3), axis)
        if kind in ("revolute", "prismatic"):
            out.limits = {"lower": -float(rng.uniform(0.5, 2)), "upper": float(rng.uniform(0.5, 2))}
        if kind in ("revolute", "prismatic") or (kind == "continuous" and rng.random() < 0.5):
            out.limits |= {"effort": float(rng.uniform(1, 9)), "velocity": float(rng.uniform(1, 9))}
        return out

    def _of(self, *kinds: str, mimics: bool = False) -> list[Joint]:
        return [j for j in self.joints if j.kind in kinds and (mimics or j.mimic is None)]

    def _couple(self) -> None:
        single = self._of(*SINGLE)
        for joint in single[1:]:
            if self.rng.random() < 0.3:
                leader = single[int(self.rng.integers(single.index(joint)))]
                joint.mimic = (leader.name, float(self.rng.uniform(-2.0, 2.0)), float(self.rng.uniform(-0.2, 0.2)))

    def _one(self, *kinds: str) -> Joint | None:
        found = self._of(*kinds)
        return found[int(self.rng.integers(len(found)))] if found else None

    def _spoiled(self, kinds: tuple[str, ...], *words: str, **changes: Callable[[Joint], Any]) -> list[str]:
        """Change fields of a joint of these kinds; its name and the words, or nothing where there is none."""
        joint = self._one(*kinds)
        if joint is None:
            return []
        for name, change in changes.items():
            setattr(joint, name, change(joint))
        return [joint.name, *words]

    def _zero_axis(self) -> list[str]:
        return self._spoiled((*SINGLE, "planar"), axis=lambda joint: np.zeros(3))

    def _two_parents(self) -> list[str]:
        child = int(self.rng.integers(1, len(self.links)))
        first = next(j for j in self.joints if j.child == child)
        self.joints.append(self._joint("second parent", "revolute", 0, child))
        return [self.links[child].name, first.name, "second parent"]

    def _lost_links(self) -> list[str]:
        k = len(self.links)
        self.links += [self._link(k), self._link(k + 1)]
        self.joints += [self._joint("there", "fixed", k, k + 1), self._joint("back", "fixed", k + 1, k)]
        return [self.links[k].name]

    def _negative_mass(self) -> list[str]:
        link = self.links[int(self.rng.integers(len(self.links)))]
        link.mass = -0.25
        return [link.name, "-0.25"]

    def _mimic_of_planar(self) -> list[str]:
        planar, joint = self._one("planar", "floating"), self._one(*SINGLE)
        if planar is None or joint is None:
            return []
        joint.mimic = (planar.name, 1.0, 0.0)
        return [planar.name]

    def _circle_of_mimics(self) -> list[str]:
        return self._spoiled(SINGLE, mimic=lambda joint: (joint.name, 1.0, 0.0))

    def _swapped_limits(self) -> list[str]:
        limits = {"lower": 0.625, "upper": -0.375}
        return self._spoiled(ENDED, "0.625", "-0.375", limits=lambda joint: joint.limits | limits)

    def _negative_effort(self) -> list[str]:
        return self._spoiled(ENDED, "-1.5", limits=lambda joint: joint.limits | {"effort": -1.5})

    def _negative_velocity(self) -> list[str]:
        return self._spoiled(ENDED, "-1.5", limits=lambda joint: joint.limits | {"velocity": -1.5})

    def _limits_of_continuous(self) -> list[str]:
        limits = {"lower": -0.875, "upper": 0.125, "effort": 3.0, "velocity": 2.0}
        return self._spoiled(("continuous",), "-0.875", "0.125", limits=lambda joint: limits)

    def _bad_inertia(self) -> list[str]:
        link = self.links[int(self.rng.integers(len(self.links)))]
        moments = [[-0.5, 1.0, 1.0], [0.25, 0.5, 2.0]][self.rng.integers(2)]
        turn = pin.exp3(self.rng.normal(size=3))
        link.inertia = turn @ np.diag(moments) @ turn.T
        return [link.name, *(f"{x:g}" for x in moments)]

    def _mimic_of_fixed(self) -> list[str]:
        fixed, joint = self._one("fixed"), self._one(*SINGLE)
        if fixed is None or joint is None or any((j.mimic or [""])[0] == joint.name for j in self.joints):
            return []
        joint.mimic = (fixed.name, 2.0, 0.125)
        return [joint.name, fixed.name, "0.125"]

    def _mimic_of_nothing(self) -> list[str]:
        return self._spoiled(SINGLE, "nobody", mimic=lambda joint: ("nobody", 2.0, 0.125))

    def _loose_joint(self) -> list[str]:
        joint = self._one("fixed")
        if joint is None or self.base(None) != "fixed" or any((j.mimic or [""])[0] == joint.name for j in self.joints):
            return []
        joint.kind, joint.axis = str(self.rng.choice(["floating", "planar"])), np.array([0.3, -0.2, 2.0])
        if self.base(None) != "fixed":
            joint.kind = "fixed"
            return []
        return [joint.name]

    def text(self) -> bytes:
        """The file."""

        def row(values: np.ndarray) -> str:
            return " ".join(repr(float(x)) for x in values)

        parts = []
        for link in self.links:
            at = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), zip(*np.triu_indices(3), strict=True), strict=True)
            moments = " ".join(f'{key}="{float(link.inertia[place])!r}"' for key, place in at)
            parts.append(
                f'<link name="{link.name}"><inertial><origin xyz="{row(link.xyz)}" rpy="{row(link.rpy)}"/>'
                f'<mass value="{link.mass!r}"/><inertia {moments}/></inertial></link>'
            )
        for joint in self.joints:
            axis = f'<axis xyz="{row(joint.axis)}"/>' if joint.axis is not None else ""
            limit = "".join(f' {key}="{value!r}"' for key, value in joint.limits.items())
            mimic = '<mimic joint="{}" multiplier="{!r}" offset="{!r}"/>'.format(*joint.mimic) if joint.mimic else ""
            parts.append(
                f'<joint name="{joint.name}" type="{joint.kind}"><parent link="{self.links[joint.parent].name}"/>'
                f'<child link="{self.links[joint.child].name}"/><origin xyz="{row(joint.xyz)}" rpy="{row(joint.rpy)}"/>'
                f"{axis}{f'<limit{limit}/>' if limit else ''}{mimic}</joint>"
            )
        self.rng.shuffle(parts)
        body, head, start = "\n".join(parts), '<?xml version="1.0"?>\n', '<robot name="random">'
        if self.odd == "blank lines":
            head = "\n \t\r\n" + head
        elif self.odd == "prefix":
            body += '<gazebo><sensor:camera x:name="eye"/></gazebo>'
        elif self.odd == "namespace":
            start = '<robot name="random" xmlns="http://www.ros.org">'
        elif self.odd == "ampersands":
            body += '<gazebo a="x&y">a && b &unknown; c</gazebo>'
        elif self.odd == "dashes":
            body += "<!-- a -- b - --- > <link name='no'/> -->"
        elif self.odd == "doctype":
            head += "<!DOCTYPE robot>"
        elif self.odd == "mark":
            head = "\ufeff" + head
        elif self.odd == "no spaces":
            start = "<robot name='random'version='1.0'>"
        text = f"{head}{start}{body}</robot>"
        return f"{text}<!-- grün -->".encode("latin-1") if self.odd == "latin-1" else text.encode()

    def base(self, wanted: str | None) -> str:
        """The base that a reader must give, "" where it must refuse the wanted one."""
        roots, still = [], {0}
        for joint in self.joints:  # parents come before children
            if joint.parent in still and joint.kind == "fixed":
                still.add(joint.child)
            elif joint.parent in still:
                roots.append(joint.kind)
        loose = [kind for kind in roots if kind in ("floating", "planar")]
        own = loose[0] if loose and len(roots) == 1 else "fixed"
        if wanted in (None, own) or (own == "planar" and wanted == "differential"):
            return own if wanted is None else wanted
        return wanted if wanted == "fixed" or not loose else ""

    def coupling(self, joint: Joint) -> tuple[str, float, float] | None:
        """(first leader, ratio, offset); the leader "" where it stands still."""
        by_name = {j.name: j for j in self.joints}
        if joint.mimic is None or joint.mimic[0] not in by_name:
            return None
        leader, ratio, offset = joint.mimic
        while (above := by_name[leader]).mimic is not None and above.mimic[0] in by_name:
            leader, ratio, offset = above.mimic[0], ratio * above.mimic[1], ratio * above.mimic[2] + offset
        return ("" if by_name[leader].kind == "fixed" else leader), ratio, offset

    def poses(self, values: dict[str, np.ndarray]) -> list[np.ndarray]:
        """Pose of every link [4 x 4] for the numbers of each joint; floating: position and quaternion x, y, z, w."""
        out = [np.eye(4) for _ in self.links]
        for joint in self.joints:
            out[joint.child] = out[joint.parent] @ _pose(joint.xyz, joint.rpy) @ _motion(joint, values.get(joint.name))
        return out


def _pose(xyz: np.ndarray, rpy: np.ndarray) -> np.ndarray:
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    out = np.eye(4)
    out[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    out[:3, 3] = xyz
    return out


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    x = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * x + (1 - np.cos(angle)) * x @ x


def _motion(joint: Joint, value: np.ndarray | None) -> np.ndarray:
    out = np.eye(4)
    if value is None or joint.kind == "fixed":
        return out
    axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else joint.axis / np.linalg.norm(joint.axis)
    if joint.kind == "prismatic":
        out[:3, 3] = axis * value[0]
    elif joint.kind in ("revolute", "continuous"):
        out[:3, :3] = _about(axis, value[0] if len(value) == 1 else np.arctan2(value[1], value[0]))
    elif joint.kind == "planar":
        # the plane's x and y are the axes x and y turned by the least turn from z to the axis
        normal = np.cross([0.0, 0.0, 1.0], axis)
        size = np.linalg.norm(normal)
        side = normal / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
        least = _about(side, np.arctan2(size, axis[2]))
        out[:3, 3] = least[:, :2] @ value[:2]
        out[:3, :3] = _about(axis, np.arctan2(value[3], value[2]))
    else:
        x, y, z, w = value[3:]
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        out[:3, :3] = np.eye(3) + 2 * w * skew + 2 * skew @ skew
        out[:3, 3] = value[:3]
    return out
