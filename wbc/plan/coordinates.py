"""The coordinates that a path is planned in: one number a joint that moves by itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from wbc.clearance import Tree
from wbc.errors import UnsupportedJointError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.joint_steps import JointKind, joint_steps
from wbc.validation import Array

#: What a planner has coordinates for
PLANNED = ("revolute", "continuous", "prismatic", "helical", "universal", "planar base", "fixed base")


@dataclass(frozen=True, eq=False)
class PlanningCoordinates:
    """Configurations q of a robot as vectors x of n numbers, without manifold:

        x_i = q_k of a joint with limits,  the angle of a joint without (q has its cosine and sine),
        x, y and angle of a planar base;   followers of mimic joints follow: ratio x_leader + offset

    Attributes:
        robot: whose. tree: its frames, moved by x.
        names: of the degrees of freedom. units: rad or m. dofs: their numbers. places: where they stand in q.
        circles: those that q has as cosine and sine.
        followers: (place in q, number of the leader's coordinate, ratio, offset).
        scale: what counts as much as a radian, [n].
    """

    robot: Robot
    tree: Tree
    names: tuple[str, ...]
    units: tuple[str, ...]
    dofs: tuple[int, ...]
    places: tuple[int, ...]
    circles: frozenset[int]
    followers: tuple[tuple[int, int, float, float], ...]
    scale: Array

    @classmethod
    def of(cls, robot: Robot, length: float) -> PlanningCoordinates:
        """Those of a robot, of which ``length`` [m] counts as much as a radian.

        Raises:
            UnsupportedJointError: a base that floats, ball joints, or a coupling of joints without end.
        """
        model = robot.model
        tree = Tree.of_model(model)
        places, dofs, circles = list[int](), list[int](), list[int]()
        for joint in range(1, model.njoints):
            if model.joints[joint].shortname() == "JointModelFreeFlyer":
                name = str(model.names[joint])
                raise UnsupportedJointError(f"joint {name!r}", "floating base", "a planner has no coordinates", PLANNED)
            seen = 0
            for step in joint_steps(model, joint):
                if step.kind == JointKind.PLACE or step.q in places:
                    continue
                if step.kind == JointKind.CIRCLE:
                    circles.append(len(places))
                places.append(step.q)
                dofs.append(int(model.idx_vs[joint]) + seen)
                seen += 1
        at = {dof: k for k, dof in enumerate(dofs)}
        leaders = {at[c.follower]: c for c in robot.couplings}
        for k, coupling in leaders.items():
            if k in circles or at[coupling.leader] in circles:
                raise UnsupportedJointError(
                    f"joint {robot.dof_names[coupling.follower]!r}", "continuous", "a planner couples none", PLANNED
                )
        own = [k for k in range(len(places)) if k not in leaders]
        number = {k: i for i, k in enumerate(own)}
        frames = list(tree.frames)
        for f, frame in enumerate(frames):
            if frame.coordinate in leaders and frame.moves in (1, 2):
                c = leaders[frame.coordinate]
                frames[f] = replace(
                    frame,
                    coordinate=number[at[c.leader]],
                    scale=frame.scale * c.ratio,
                    offset=frame.scale * c.offset + frame.offset,
                )
            elif frame.moves in (1, 2):
                frames[f] = replace(frame, coordinate=number[frame.coordinate])
        names = tuple(robot.dof_names[dofs[k]] for k in own)
        units = tuple(robot.dof_units[dofs[k]] for k in own)
        return cls(
            robot,
            _about_z(Tree(tuple(frames), names, (), tree.links)),
            names,
            units,
            tuple(dofs[k] for k in own),
            tuple(places[k] for k in own),
            frozenset(number[k] for k in circles),
            tuple((places[k], number[at[c.leader]], c.ratio, c.offset) for k, c in leaders.items()),
            np.array([length if unit == "m" else 1.0 for unit in units]),
        )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.names)

    @cached_property
    def _circle(self) -> np.ndarray:
        return np.array(sorted(self.circles), dtype=int)

    def of_configuration(self, q: Array, near: Array | None = None) -> Array:
        """x of a configuration [nq], or of several; angles of joints without end are those nearest to ``near``."""
        x = np.asarray(q)[..., list(self.places)].copy()
        for k in self.circles:
            place = self.places[k]
            x[..., k] = np.arctan2(q[..., place + 1], q[..., place])
            if near is not None:
                x[..., k] += 2.0 * np.pi * np.round((near[k] - x[..., k]) / (2.0 * np.pi))
        return np.asarray(x)

    def configuration(self, x: Array) -> Array:
        """The configuration [nq] of x, or of several."""
        x = np.asarray(x, dtype=np.float64)
        q = np.tile(self.robot.neutral, (*x.shape[:-1], 1)) if x.ndim > 1 else self.robot.neutral.copy()
        for k, place in enumerate(self.places):
            q[..., place] = np.cos(x[..., k]) if k in self.circles else x[..., k]
            if k in self.circles:
                q[..., place + 1] = np.sin(x[..., k])
        for place, leader, ratio, offset in self.followers:
            q[..., place] = ratio * x[..., leader] + offset
        return q

    def velocity(self, x: Array, rate: Array) -> Array:
        """The velocity [nv] of the configuration at x, where x changes at ``rate``; or of several."""
        v = np.zeros((*np.shape(rate)[:-1], self.robot.nv))
        for k, dof in enumerate(self.dofs):
            v[..., dof] = rate[..., k]
        dofs = {place: dof for dof, place in enumerate(self.robot.position_index)}
        for place, leader, ratio, _ in self.followers:
            v[..., dofs[place]] = ratio * rate[..., leader]
        if self.robot.base in ("planar", "differential"):
            # The base's velocity is along its own axes
            c, s = np.cos(x[..., 2]), np.sin(x[..., 2])
            v[..., 0], v[..., 1] = c * rate[..., 0] + s * rate[..., 1], c * rate[..., 1] - s * rate[..., 0]
        return v

    def expression(self, x: ca.SX) -> ca.SX:
        """The configuration as an expression of x."""
        q = ca.SX(ca.DM(self.robot.neutral))
        for k, place in enumerate(self.places):
            q[place] = ca.cos(x[k]) if k in self.circles else x[k]
            if k in self.circles:
                q[place + 1] = ca.sin(x[k])
        for place, leader, ratio, offset in self.followers:
            q[place] = ratio * x[leader] + offset
        return q

    def limits(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Limits of x of those of the degrees of freedom [nv]; infinite where there is none."""
        low, high = lower[list(self.dofs)].copy(), upper[list(self.dofs)].copy()
        for k in self.circles:
            low[k], high[k] = -np.inf, np.inf
        dofs = {place: dof for dof, place in enumerate(self.robot.position_index)}
        for place, leader, ratio, offset in self.followers:
            ends = sorted((side[dofs[place]] - offset) / ratio for side in (lower, upper))
            low[leader], high[leader] = max(low[leader], ends[0]), min(high[leader], ends[1])
        return low, high


def _about_z(tree: Tree) -> Tree:
    """The same tree with frames turned so that all joints turn about z or shift along it."""
    turns = [_turn_to(frame.axis) if frame.moves in (1, 2) else pin.SE3.Identity() for frame in tree.frames]
    frames = []
    for turn, frame in zip(turns, tree.frames, strict=True):
        place = frame.place * turn if frame.parent < 0 else turns[frame.parent].inverse() * frame.place * turn
        frames.append(replace(frame, place=place, axis=(0.0, 0.0, 1.0)))
    links = {name: (k, pose if k < 0 else turns[k].inverse() * pose) for name, (k, pose) in tree.links.items()}
    return replace(tree, frames=tuple(frames), links=links)


def _turn_to(axis: tuple[float, float, float]) -> pin.SE3:
    """A turn that leads z to an axis."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), np.zeros(3))
