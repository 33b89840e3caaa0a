"""The bodies that a stack keeps apart, as a scene for the proofs of clearance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.clearance import Nearest, Pair, Sweeper, SweptBody, SweptScene
from wbc.clearance.barriers import Barriers
from wbc.clearance.motion import Motion
from wbc.controller.core import Core
from wbc.multibody import pin
from wbc.plan.coordinates import PlanningCoordinates
from wbc.plan.stand_in import MeasuredApart
from wbc.shapes import PlacedShape
from wbc.tasks import SelfCollision
from wbc.trajectory import PolynomialPath
from wbc.validation import Array

#: What a proof leaves open: distances are kept to this [m]
OPEN = 1e-4


@dataclass(frozen=True, eq=False)
class PlanningScene:
    """Pairs of bodies and the distances that they keep: obstacles where they are now, and links among each other.

    Attributes:
        coordinates: that move the robot.
        bodies, pairs: of :mod:`wbc.clearance`.
        key: the run-time values that it was made of, and what was enabled.
    """

    coordinates: PlanningCoordinates
    bodies: tuple[SweptBody, ...]
    pairs: tuple[Pair, ...]
    key: bytes

    @classmethod
    def of(cls, core: Core, coordinates: PlanningCoordinates, key: bytes) -> PlanningScene:
        """That of a stack's obstacles and self-collisions which are enabled, at their present run-time values."""
        bodies, pairs = dict[str, SweptBody](), list[Pair]()

        def on_link(link: str, number: int, placed: PlacedShape) -> str:
            name = f"{link}[{number}]"
            bodies.setdefault(name, SweptBody(name, placed.shape, link, placed.placement))
            return name

        for entry in core.stack.constraints:
            soft = entry.price is not None or not entry.hard
            if soft or not isinstance(entry.item, MeasuredApart) or not core.handles[entry.name].enabled:
                continue
            item, robot = entry.item.item, core.stack.robot
            values = {n: core.tick.p[s.span] for n, s in core.layout.blocks[entry.name].slots.items()}
            margin = float(values["margin"][0])
            if isinstance(item, SelfCollision):
                for (one, other), most in item.kept_pairs(robot):
                    pairs.append(Pair(on_link(*one), on_link(*other), min(margin, most)))
                continue
            pose = pin.SE3(values["pose"][:9].reshape(3, 3, order="F"), values["pose"][9:])
            pose = core.frame_pose(entry.name) * pose
            parts = []
            for k, shape in enumerate(item.parts):
                name = entry.name if len(item.parts) == 1 else f"{entry.name}[{k}]"
                name = f"{name} (obstacle)" if name in coordinates.tree.links else name
                bodies[name] = SweptBody(name, shape, placement=pose)
                parts.append(name)
            for body in item.pairs(robot):
                pairs += [Pair(on_link(*body), part, margin) for part in parts]
        return cls(coordinates, tuple(bodies.values()), tuple(pairs), key)

    @staticmethod
    def places_of(core: Core) -> Array:
        """Where the run-time values that a scene is made of stand among all."""
        spans = [np.zeros(0, dtype=int)]
        for entry in core.stack.constraints:
            if isinstance(entry.item, MeasuredApart):
                slots = core.layout.blocks[entry.name].slots
                spans += [np.r_[slots[n].span] for n in ("pose", "margin") if n in slots]
                spans += [np.r_[core.layout.blocks[entry.frame].slots["pose"].span]] if entry.frame else []
        return np.concatenate(spans)

    @cached_property
    def sweeper(self) -> Sweeper:
        """Proofs of motions, to :data:`OPEN`."""
        return Sweeper(SweptScene(self.coordinates.tree, self.bodies, self.pairs))

    def nearest(self, x: Array) -> Nearest | None:
        """The pair of the least margin at x; None where there is no pair."""
        if not self.pairs:
            return None
        still = Motion.linear(self.coordinates.tree, [0.0, 1.0], np.array([x, x]))
        return self.sweeper.sweep(still, aim="least", tolerance=1e-6, far=np.inf).nearest

    def separation(self, low: Array, high: Array, start: Array, goal: Array) -> str:
        """What keeps a start and a goal apart on all paths within limits; empty: nothing is proven."""
        circles = self.coordinates.circles
        return Barriers(self.coordinates.tree, self.bodies, self.pairs, low, high, circles).between(start, goal)

    def violation(self, path: PolynomialPath) -> Nearest | None:
        """Where two bodies are nearer than they may be on a path of the coordinates, or where that is not proven; None:
        nowhere.
        """
        if not self.pairs:
            return None
        motion = Motion.polynomial(self.coordinates.tree, path.knots, path.hull())
        swept = self.sweeper.sweep(motion, aim="any", tolerance=OPEN)
        return None if swept.clear else swept.nearest
