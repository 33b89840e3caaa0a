"""The coordinates that a path is planned in: one number a joint that moves by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from wbc.clearance import Tree
from wbc.clearance.tree import Moves
from wbc.errors import UnsupportedJointError
from wbc.plan.rolling import ANY_WAY, RollingBase
from wbc.robot import Robot
from wbc.rotations import matrices
from wbc.symbolic.ball_turns import BallTurns
from wbc.symbolic.joint_steps import JointKind, joint_steps, turns_for_quaternions
from wbc.validation import Array

#: Joints of which one may follow another
COUPLED = ("revolute", "prismatic", "helical")


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
                ball = BallTurns(len(places) + 3 * floats, step.q, floats)
                balls.append(ball if q is None else ball.suited(q))
                orders[step.q] = balls[-1].order
            for step in turns_for_quaternions(steps, orders):
                if step.kind != JointKind.PLACE and step.q not in places:
                    circles |= {len(places)} if step.kind == JointKind.CIRCLE else set()
                    places.append(step.q)
        # Places are in the order of the degrees of freedom
        for c in robot.couplings:
            if circles & {c.follower, c.leader}:
                field = f"joint {robot.dof_names[c.follower]!r}"
                raise UnsupportedJointError(field, "continuous", "a planner couples none", COUPLED)
        own = sorted(set(range(len(places))) - {c.follower for c in robot.couplings})
        number = {dof: k for k, dof in enumerate(own)}
        followers = tuple((c.follower, number[c.leader], c.ratio, c.offset) for c in robot.couplings)
        labels = list(robot.dof_names)
        for ball in balls:
            owner = labels[ball.number].rpartition(".")[0]
            labels[ball.number : ball.number + 3] = [f"{owner}.r{'xyz'[axis]}" for axis in ball.order]
        names, units = tuple(labels[dof] for dof in own), tuple(robot.dof_units[dof] for dof in own)
        moved_by = {dof: (k, 1.0, 0.0) for dof, k in number.items()} | {
            f: (k, ratio, offset) for f, k, ratio, offset in followers
        }
        tree = Tree.of_model(model, orders=orders).moved_by(names, moved_by)
        if rolling is not None:
            # What turns with the base does so about its axle
            base = next(f for f, frame in enumerate(tree.frames) if frame.moves == Moves.TURNING)
            tree = tree.shifted(base, -np.array([*rolling.axle, 0.0]))
        scale = np.array([length if unit == "m" else 1.0 for unit in units])
        scale[[number[dof] for dof in (rolling.wheels if rolling else ())]] = np.inf
        return cls(
            robot=robot,
            tree=tree.about_z(),
            names=names,
            units=units,
            dofs=tuple(own),
            places=tuple(places[dof] for dof in own),
            circles=frozenset(number[dof] for dof in circles),
            balls=tuple(replace(ball, number=number[ball.number]) for ball in balls),
            followers=followers,
            scale=scale,
            rolling=rolling,
        )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.names)

    def suits(self, q: Array) -> bool:
        """Whether no turns of a ball joint are steep at a configuration."""
        return all(ball.suits(q) for ball in self.balls)

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
        robot = self.robot
        if not robot.couplings:
            return 0.0, ""
        off = q - self.configuration(self.of_configuration(q))
        worst = max(robot.couplings, key=lambda c: abs(off[robot.position_index[c.follower]]))
        far, dof = float(off[robot.position_index[worst.follower]]), worst.follower
        says = (
            f"follows {robot.dof_names[worst.leader]} and is {far:.3g} {robot.dof_units[dof]} from where it has to be"
        )
        return far, f"{robot.dof_names[dof]} {says}"

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
