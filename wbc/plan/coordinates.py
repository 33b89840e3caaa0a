"""The coordinates that a path is planned in: one number a joint that moves by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from wbc.clearance import Tree
from wbc.clearance.tree import SCALAR, Moves
from wbc.errors import UnsupportedJointError
from wbc.multibody import pin
from wbc.plan.rolling import ANY_WAY, RollingBase
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
        """(x, y, z, w) at coordinates [n, ...], in numpy or CasADi."""
        first, second, third = (self._turn(k, x[self.number + k], math) for k in range(3))
        return quaternion_product(quaternion_product(first, second), third)

    def _turn(self, k: int, angle: Any, math: ModuleType) -> list[Any]:
        out = [0.0 * angle] * 3 + [math.cos(0.5 * angle)]
        out[self.order[k]] = math.sin(0.5 * angle)
        return out

    def angular_velocity(self, x: Array, rate: Array) -> Array:
        """In the axes of what it carries [..., 3]; x and its rates are [n, ...]."""
        i, j, k = self.order
        second, third = (self._turn(m, x[self.number + m], np) for m in (1, 2))
        after = [matrices(np.stack(turns, axis=-1)) for turns in (quaternion_product(second, third), third)]
        a, b, c = rate[self.span]
        return np.asarray(
            a[..., None] * after[0][..., i, :] + b[..., None] * after[1][..., j, :] + c[..., None] * np.eye(3)[k]
        )


@dataclass(frozen=True, eq=False)
class PlanningCoordinates:
    """Configurations q of a robot as vectors x of n numbers, without manifold:

        x_i = q_k of a joint with limits,  the angle of a joint without (q has its cosine and sine),
        x, y of a point of a planar base and its angle,  the position of a floating base,
        three turns of it and of a ball joint;
        followers of mimic joints follow: ratio x_leader + offset

    Attributes:
        robot: whose. tree: its frames, moved by x.
        names: of the degrees of freedom. units: rad or m. dofs: their numbers. places: where they stand in q.
        circles: those that q has as cosine and sine. balls: ball joints and floating bases.
        followers: (degree of freedom, number of the leader's coordinate, ratio, offset).
        scale: what counts as much as a radian, [n]; infinite of wheels that follow a base.
        rolling: how the base rolls, if it does: that point is its axle's; else the origin.
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
    rolling: RollingBase | None

    @classmethod
    def of(
        cls, robot: Robot, length: float, q: Array | None = None, rolling: RollingBase | None = None
    ) -> PlanningCoordinates:
        """Those of a robot, of which ``length`` [m] counts as much as a radian; turns of ball joints are in an order in
        which they are not steep at ``q``.

        Raises:
            UnsupportedJointError: a joint without a symbolic model, or a coupling of joints without end.
        """
        model = robot.model
        places, circles = list[int](), set[int]()
        balls, orders = list[BallTurns](), dict[int, tuple[int, int, int]]()
        for joint in range(1, model.njoints):
            steps = joint_steps(model, joint)
            for step in (step for step in steps if step.kind == JointKind.QUATERNION):
                floats = model.joints[joint].shortname() == "JointModelFreeFlyer"
                ball = BallTurns(len(places) + 3 * floats, step.q, ORDERS[0], floats)
                if q is not None and ball.steep(q, ball.order) > STEEP:
                    ball = replace(ball, order=min(ORDERS, key=lambda order: ball.steep(q, order)))
                balls.append(ball)
                orders[step.q] = ball.order
            for step in turns_for_quaternions(steps, orders):
                if step.kind != JointKind.PLACE and step.q not in places:
                    circles |= {len(places)} if step.kind == JointKind.CIRCLE else set()
                    places.append(step.q)
        tree = Tree.of_model(model, orders=orders)
        # Places are in the order of the degrees of freedom
        for c in robot.couplings:
            if circles & {c.follower, c.leader}:
                field = f"joint {robot.dof_names[c.follower]!r}"
                raise UnsupportedJointError(field, "continuous", "a planner couples none", COUPLED)
        own = sorted(set(range(len(places))) - {c.follower for c in robot.couplings})
        number = {dof: k for k, dof in enumerate(own)}
        moved_by = {dof: (k, 1.0, 0.0) for dof, k in number.items()}
        moved_by |= {c.follower: (number[c.leader], c.ratio, c.offset) for c in robot.couplings}
        frames, links = list(tree.frames), tree.links
        for f, frame in enumerate(frames):
            if frame.moves in SCALAR:
                k, ratio, offset = moved_by[frame.coordinate]
                scale, offset = frame.scale * ratio, frame.scale * offset + frame.offset
                frames[f] = replace(frame, coordinate=k, scale=scale, offset=offset)
        if rolling is not None:
            # What turns with the base does so about its axle
            base = next(f for f, frame in enumerate(frames) if frame.moves == Moves.TURNING)
            back = pin.SE3(np.eye(3), -np.array([*rolling.axle, 0.0]))
            frames = [replace(f, place=back * f.place) if f.parent == base else f for f in frames]
            links = {name: (k, back * pose if k == base else pose) for name, (k, pose) in links.items()}
        labels = list(robot.dof_names)
        for ball in balls:
            owner = labels[ball.number].rpartition(".")[0]
            labels[ball.number : ball.number + 3] = [f"{owner}.r{'xyz'[axis]}" for axis in ball.order]
        names, units = tuple(labels[dof] for dof in own), tuple(robot.dof_units[dof] for dof in own)
        counts_as = np.array([length if unit == "m" else 1.0 for unit in units])
        counts_as[[number[dof] for dof in (rolling.wheels if rolling else ())]] = np.inf
        return cls(
            robot,
            Tree(tuple(frames), names, (), links).about_z(),
            names,
            units,
            tuple(own),
            tuple(places[dof] for dof in own),
            frozenset(number[dof] for dof in circles),
            tuple(replace(ball, number=number[ball.number]) for ball in balls),
            tuple((c.follower, *moved_by[c.follower]) for c in robot.couplings),
            counts_as,
            rolling,
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
        if self.rolling is not None:
            x[:2] += np.array(self.rolling.at(x[2], np))
        for ball in self.balls:
            x[ball.span] = ball.angles(q, near[ball.span])
        return x

    def configuration(self, x: Array) -> Array:
        """The configuration [nq] of x, or of several."""
        x = np.asarray(x, dtype=np.float64)
        q = np.tile(self.robot.neutral, (*x.shape[:-1], 1))
        for place, value in self._numbers(np.moveaxis(x, -1, 0), np):
            q[..., place] = value
        return q

    def expression(self, x: ca.SX) -> ca.SX:
        """The configuration as an expression of x."""
        q = ca.SX(ca.DM(self.robot.neutral))
        for place, value in self._numbers(x, ca):
            q[place] = value
        return q

    def _numbers(self, x: Any, math: ModuleType) -> Iterator[tuple[int, Any]]:
        """Places in q and what stands there, of x [n, ...], in numpy or CasADi."""
        shift = () if self.rolling is None else self.rolling.at(x[2], math)
        for k, place in enumerate(self.places):
            yield place, math.cos(x[k]) if k in self.circles else x[k] - (shift[k] if k < len(shift) else 0.0)
            if k in self.circles:
                yield place + 1, math.sin(x[k])
        for ball in self.balls:
            yield from enumerate(ball.quaternion(x, math), ball.place)
        for dof, leader, ratio, offset in self.followers:
            yield self.robot.position_index[dof], ratio * x[leader] + offset

    def uncoupled(self, q: Array) -> tuple[float, str]:
        """How far the worst follower is from where its leader has it [rad or m], and what to say of it."""
        robot, off = self.robot, q - self.configuration(self.of_configuration(q))
        far = {float(off[robot.position_index[coupling.follower]]): coupling for coupling in robot.couplings}
        if not far:
            return 0.0, ""
        worst = max(far, key=abs)
        row, leader = far[worst].follower, far[worst].leader
        says = f"follows {robot.dof_names[leader]} and is {worst:.3g} {robot.dof_units[row]} from where it has to be"
        return worst, f"{robot.dof_names[row]} {says}"

    def velocity(self, x: Array, rate: Array) -> Array:
        """The velocity [nv] of the configuration at x, where x changes at ``rate``; or of several."""
        v = np.zeros((*np.shape(rate)[:-1], self.robot.nv))
        v[..., self.dofs] = rate
        x, rate = np.moveaxis(x, -1, 0), np.moveaxis(rate, -1, 0)
        for dof, leader, ratio, _ in self.followers:
            v[..., dof] = ratio * rate[leader]
        if self.robot.base in ("planar", "differential"):
            v[..., :3] = np.moveaxis((self.rolling or ANY_WAY).twist(x[2], rate[:3]), 0, -1)
        for ball in self.balls:
            dof = self.dofs[ball.number]
            v[..., dof : dof + 3] = ball.angular_velocity(x, rate)
            if ball.carries:
                rotation = matrices(np.stack(ball.quaternion(x, np), axis=-1))
                v[..., dof - 3 : dof] = np.einsum(
                    "...ij,...i->...j", rotation, np.moveaxis(rate[ball.number - 3 : ball.number], 0, -1)
                )
        return v

    def rates(self, limits: Array) -> Array:
        """Limits of the rates of x [n] at which no degree of freedom exceeds its own [nv], wherever axes point."""
        out = limits[list(self.dofs)].copy()
        if self.robot.base in ("planar", "differential"):
            out[:3] = (self.rolling or ANY_WAY).rates(limits[:3])
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
        endless = [*self.circles, *(ball.number + k for ball in self.balls for k in range(3))]
        low[endless], high[endless] = -np.inf, np.inf
        for dof, leader, ratio, offset in (follower for follower in self.followers if follower[2]):
            ends = sorted((side[dof] - offset) / ratio for side in (lower, upper))
            low[leader], high[leader] = max(low[leader], ends[0]), min(high[leader], ends[1])
        return low, high
