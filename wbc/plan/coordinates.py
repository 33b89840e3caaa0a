"""The coordinates that a path is planned in: one number a joint that moves by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from wbc.clearance import Tree
from wbc.errors import UnsupportedJointError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.rotations import exponential, matrices, quaternion_product
from wbc.symbolic.joint_steps import JointKind, joint_steps, turns_for_quaternions
from wbc.validation import Array

#: Joints of which one may follow another
COUPLED = ("revolute", "prismatic", "helical")
#: Axes of the three turns of a ball joint, the usual order first
ORDERS = ((2, 1, 0), (0, 2, 1), (1, 0, 2), (0, 1, 2), (1, 2, 0), (2, 0, 1))
#: Another order of axes is taken where the sine of the second turn would be larger: at 1 two turns are about one axis
STEEP = 0.8


@dataclass(frozen=True)
class BallTurns:
    """Three turns for a ball joint, or for the rotation of a floating base:

        R = exp(a [e_i]) exp(b [e_j]) exp(c [e_k])

    Attributes:
        number: of a among the coordinates; b and c follow. place: of the quaternion in q. order: (i, j, k).
        carries: the three coordinates before a are the position of a floating base.
    """

    number: int
    place: int
    order: tuple[int, int, int]
    carries: bool

    @property
    def span(self) -> slice:
        """The three coordinates."""
        return slice(self.number, self.number + 3)

    def steep(self, q: Array, order: tuple[int, int, int]) -> float:
        """|sin b| of the three turns in an order."""
        return float(abs(matrices(q[self.place : self.place + 4])[order[0], order[2]]))

    def angles(self, q: Array, near: Array) -> Array:
        """(a, b, c) of a configuration, those nearest to ``near`` of all that there are."""
        axes = np.eye(3)[list(self.order)]
        sign = np.linalg.det(axes)
        turned = axes @ matrices(q[self.place : self.place + 4]) @ axes.T
        level = np.hypot(turned[1, 2], turned[2, 2]) > 1e-9
        first = np.arctan2(-turned[1, 2], turned[2, 2]) if level else sign * near[0]
        found = []
        for a in (first, first + np.pi):
            rest = exponential(np.array([[-a, 0.0, 0.0]]))[0] @ turned
            x = sign * np.array([a, np.arctan2(rest[0, 2], rest[2, 2]), np.arctan2(rest[1, 0], rest[1, 1])])
            found.append(x + 2.0 * np.pi * np.round((near - x) / (2.0 * np.pi)))
        return min(found, key=lambda x: float(np.linalg.norm(x - near)))

    def quaternion(self, x: Any, math: ModuleType) -> list[Any]:
        """(x, y, z, w) at coordinates, in numpy or CasADi."""
        first, second, third = (
            self._turn(k, x[..., self.number + k] if math is np else x[self.number + k], math) for k in range(3)
        )
        return quaternion_product(quaternion_product(first, second), third)

    def _turn(self, k: int, angle: Any, math: ModuleType) -> list[Any]:
        out = [0.0 * angle] * 3 + [math.cos(0.5 * angle)]
        out[self.order[k]] = math.sin(0.5 * angle)
        return out

    def angular_velocity(self, x: Array, rate: Array) -> Array:
        """In the axes of what it carries [..., 3]."""
        i, j, k = self.order
        second, third = (self._turn(m, x[..., self.number + m], np) for m in (1, 2))
        after = [matrices(np.stack(turns, axis=-1)) for turns in (quaternion_product(second, third), third)]
        a, b, c = np.moveaxis(rate[..., self.span], -1, 0)
        return np.asarray(
            a[..., None] * after[0][..., i, :] + b[..., None] * after[1][..., j, :] + c[..., None] * np.eye(3)[k]
        )


@dataclass(frozen=True, eq=False)
class PlanningCoordinates:
    """Configurations q of a robot as vectors x of n numbers, without manifold:

        x_i = q_k of a joint with limits,  the angle of a joint without (q has its cosine and sine),
        x, y and angle of a planar base,   the position of a floating base,   three turns of it and of a ball joint;
        followers of mimic joints follow: ratio x_leader + offset

    Attributes:
        robot: whose. tree: its frames, moved by x.
        names: of the degrees of freedom. units: rad or m. dofs: their numbers. places: where they stand in q.
        circles: those that q has as cosine and sine. balls: ball joints and floating bases.
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
    balls: tuple[BallTurns, ...]
    followers: tuple[tuple[int, int, float, float], ...]
    scale: Array

    @classmethod
    def of(cls, robot: Robot, length: float, q: Array | None = None) -> PlanningCoordinates:
        """Those of a robot, of which ``length`` [m] counts as much as a radian; turns of ball joints are in an order in
        which they are not steep at ``q``.

        Raises:
            UnsupportedJointError: a joint without a symbolic model, or a coupling of joints without end.
        """
        model = robot.model
        places, dofs, circles = list[int](), list[int](), list[int]()
        balls, orders = list[BallTurns](), dict[int, tuple[int, int, int]]()
        for joint in range(1, model.njoints):
            seen, steps = 0, joint_steps(model, joint)
            for step in steps:
                if step.kind == JointKind.QUATERNION:
                    floats = model.joints[joint].shortname() == "JointModelFreeFlyer"
                    ball = BallTurns(len(places) + 3 * floats, step.q, ORDERS[0], floats)
                    if q is not None and ball.steep(q, ball.order) > STEEP:
                        ball = replace(ball, order=min(ORDERS, key=lambda order: ball.steep(q, order)))
                    balls.append(ball)
                    orders[step.q] = ball.order
            for step in turns_for_quaternions(steps, orders):
                if step.kind == JointKind.PLACE or step.q in places:
                    continue
                if step.kind == JointKind.CIRCLE:
                    circles.append(len(places))
                places.append(step.q)
                dofs.append(int(model.idx_vs[joint]) + seen)
                seen += 1
        tree = Tree.of_model(model, orders=orders)
        at = {dof: k for k, dof in enumerate(dofs)}
        leaders = {at[c.follower]: c for c in robot.couplings}
        for k, coupling in leaders.items():
            if k in circles or at[coupling.leader] in circles:
                raise UnsupportedJointError(
                    f"joint {robot.dof_names[coupling.follower]!r}", "continuous", "a planner couples none", COUPLED
                )
        own = [k for k in range(len(places)) if k not in leaders]
        number = {k: i for i, k in enumerate(own)}
        frames = list(tree.frames)
        for f, frame in enumerate(frames):
            if frame.coordinate in leaders and frame.moves in (1, 2):
                c = leaders[frame.coordinate]
                scale, offset = frame.scale * c.ratio, frame.scale * c.offset + frame.offset
                frames[f] = replace(frame, coordinate=number[at[c.leader]], scale=scale, offset=offset)
            elif frame.moves in (1, 2):
                frames[f] = replace(frame, coordinate=number[frame.coordinate])
        labels = [robot.dof_names[dof] for dof in dofs]
        for ball in balls:
            owner = labels[ball.number].rpartition(".")[0]
            labels[ball.number : ball.number + 3] = [f"{owner}.r{'xyz'[axis]}" for axis in ball.order]
        names = tuple(labels[k] for k in own)
        units = tuple(robot.dof_units[dofs[k]] for k in own)
        return cls(
            robot,
            _about_z(Tree(tuple(frames), names, (), tree.links)),
            names,
            units,
            tuple(dofs[k] for k in own),
            tuple(places[k] for k in own),
            frozenset(number[k] for k in circles),
            tuple(replace(ball, number=number[ball.number]) for ball in balls),
            tuple((places[k], number[at[c.leader]], c.ratio, c.offset) for k, c in leaders.items()),
            np.array([length if unit == "m" else 1.0 for unit in units]),
        )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.names)

    def suits(self, q: Array) -> bool:
        """Whether no turns of a ball joint are steep at a configuration."""
        return all(ball.steep(q, ball.order) <= STEEP for ball in self.balls)

    def of_configuration(self, q: Array, near: Array | None = None) -> Array:
        """x of a configuration [nq]; angles of joints without end are those nearest to ``near``."""
        x, near = np.asarray(q)[list(self.places)], np.zeros(self.count) if near is None else near
        for k in self.circles:
            angle = np.arctan2(q[self.places[k] + 1], q[self.places[k]])
            x[k] = angle + 2.0 * np.pi * np.round((near[k] - angle) / (2.0 * np.pi))
        for ball in self.balls:
            x[ball.span] = ball.angles(q, near[ball.span])
        return x

    def configuration(self, x: Array) -> Array:
        """The configuration [nq] of x, or of several."""
        x = np.asarray(x, dtype=np.float64)
        q = np.tile(self.robot.neutral, (*x.shape[:-1], 1))
        for place, value in self._numbers(x, np):
            q[..., place] = value
        return q

    def expression(self, x: ca.SX) -> ca.SX:
        """The configuration as an expression of x."""
        q = ca.SX(ca.DM(self.robot.neutral))
        for place, value in self._numbers(x, ca):
            q[place] = value
        return q

    def _numbers(self, x: Any, math: ModuleType) -> Iterator[tuple[int, Any]]:
        """Places in q and what stands there, in numpy or CasADi."""
        column: Callable[[int], Any] = (lambda k: x[..., k]) if math is np else (lambda k: x[k])
        for k, place in enumerate(self.places):
            yield place, math.cos(column(k)) if k in self.circles else column(k)
            if k in self.circles:
                yield place + 1, math.sin(column(k))
        for ball in self.balls:
            yield from enumerate(ball.quaternion(x, math), ball.place)
        for place, leader, ratio, offset in self.followers:
            yield place, ratio * column(leader) + offset

    def uncoupled(self, q: Array) -> tuple[float, str]:
        """How far the worst follower is from where its leader has it [rad or m], and what to say of it."""
        if not self.robot.couplings:
            return 0.0, ""
        robot, off = self.robot, q - self.configuration(self.of_configuration(q))
        far = {float(off[robot.position_index[coupling.follower]]): coupling for coupling in robot.couplings}
        worst = max(far, key=abs)
        row, leader = far[worst].follower, far[worst].leader
        says = f"follows {robot.dof_names[leader]} and is {worst:.3g} {robot.dof_units[row]} from where it has to be"
        return worst, f"{robot.dof_names[row]} {says}"

    def velocity(self, x: Array, rate: Array) -> Array:
        """The velocity [nv] of the configuration at x, where x changes at ``rate``; or of several."""
        v = np.zeros((*np.shape(rate)[:-1], self.robot.nv))
        for k, dof in enumerate(self.dofs):
            v[..., dof] = rate[..., k]
        dofs = {place: dof for dof, place in enumerate(self.robot.position_index)}
        for place, leader, ratio, _ in self.followers:
            v[..., dofs[place]] = ratio * rate[..., leader]
        if self.robot.base in ("planar", "differential"):
            # A base's velocity is along its own axes
            c, s = np.cos(x[..., 2]), np.sin(x[..., 2])
            v[..., 0], v[..., 1] = c * rate[..., 0] + s * rate[..., 1], c * rate[..., 1] - s * rate[..., 0]
        for ball in self.balls:
            dof = self.dofs[ball.number]
            v[..., dof : dof + 3] = ball.angular_velocity(x, rate)
            if ball.carries:
                rotation = matrices(np.stack(ball.quaternion(x, np), axis=-1))
                v[..., dof - 3 : dof] = np.einsum(
                    "...ij,...i->...j", rotation, rate[..., ball.number - 3 : ball.number]
                )
        return v

    def rates(self, limits: Array) -> Array:
        """Limits of the rates of x [n] at which no degree of freedom exceeds its own [nv], wherever axes point."""
        out = limits[list(self.dofs)].copy()
        if self.robot.base in ("planar", "differential"):
            out[:2] = out[:2].min() / np.sqrt(2.0)
        for ball in self.balls:
            # The turns are not about axes at right angles
            out[ball.span] = out[ball.span].min() / 3.0
            if ball.carries:
                shifts = slice(ball.number - 3, ball.number)
                out[shifts] = out[shifts].min() / np.sqrt(3.0)
        return out

    def limits(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Limits of x of those of the degrees of freedom [nv]; infinite where there is none."""
        low, high = lower[list(self.dofs)].copy(), upper[list(self.dofs)].copy()
        for k in (*self.circles, *(k for ball in self.balls for k in range(3 + ball.number)[ball.span])):
            low[k], high[k] = -np.inf, np.inf
        dofs = {place: dof for dof, place in enumerate(self.robot.position_index)}
        for place, leader, ratio, offset in (follower for follower in self.followers if follower[2]):
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
