"""The bodies that a stack keeps apart, as a scene for the proofs of clearance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wbc.clearance import Nearest, Pair, Sweeper, SweptBody, SweptScene
from wbc.clearance.motion import Motion
from wbc.controller.core import Core
from wbc.multibody import pin
from wbc.plan.coordinates import PlanningCoordinates
from wbc.plan.stand_in import MeasuredApart
from wbc.tasks import SelfCollision
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
    sweepers: dict[str, Sweeper] = field(default_factory=dict)

    @classmethod
    def of(cls, core: Core, coordinates: PlanningCoordinates, key: bytes = b"") -> PlanningScene:
        """That of a stack's obstacles and self-collisions which are enabled, at their present run-time values."""
        bodies: dict[str, SweptBody] = {}
        pairs: list[Pair] = []
        for entry in core.stack.constraints:
            if not isinstance(entry.item, MeasuredApart):
                continue
            item, robot = entry.item.item, core.stack.robot
            if not core.handles[entry.name].enabled:
                continue
            if entry.price is not None or not entry.hard:
                continue
            values = {n: core.tick.p[s.span] for n, s in core.layout.blocks[entry.name].slots.items()}
            margin = float(values["margin"][0])
            if isinstance(item, SelfCollision):
                for (a, b), most in item.kept_pairs(robot):
                    for link, number, placed in (a, b):
                        name = f"{link}[{number}]"
                        bodies.setdefault(name, SweptBody(name, placed.shape, link, placed.placement))
                    pairs.append(Pair(f"{a[0]}[{a[1]}]", f"{b[0]}[{b[1]}]", min(margin, most)))
                continue
            pose = pin.SE3(values["pose"][:9].reshape(3, 3, order="F"), values["pose"][9:])
            pose = core.frame_pose(entry.name) * pose
            parts = []
            for k, shape in enumerate(item.parts):
                name = entry.name if len(item.parts) == 1 else f"{entry.name}[{k}]"
                name = f"{name} (obstacle)" if name in coordinates.tree.links else name
                bodies[name] = SweptBody(name, shape, placement=pose)
                parts.append(name)
            for link, number, placed in item.pairs(robot):
                name = f"{link}[{number}]"
                bodies.setdefault(name, SweptBody(name, placed.shape, link, placed.placement))
                pairs += [Pair(name, part, margin) for part in parts]
        return cls(coordinates, tuple(bodies.values()), tuple(pairs), key)

    @staticmethod
    def key_of(core: Core, places: Array) -> bytes:
        """The run-time values at ``places`` that a scene is made of, and what is enabled."""
        return bytes(core.tick.p[places].tobytes()) + bytes(handle.enabled for handle in core.handles.values())

    @staticmethod
    def places_of(core: Core) -> Array:
        """Where these stand among all run-time values."""
        spans = [np.zeros(0, dtype=int)]
        for entry in core.stack.constraints:
            if isinstance(entry.item, MeasuredApart):
                slots = core.layout.blocks[entry.name].slots
                spans += [np.r_[slots[n].span] for n in ("pose", "margin") if n in slots]
                spans += [np.r_[core.layout.blocks[entry.frame].slots["pose"].span]] if entry.frame else []
        return np.concatenate(spans)

    def swept(self) -> SweptScene:
        """The scene, of which a proof may leave :data:`OPEN`."""
        pairs = [Pair(p.first, p.second, p.required - OPEN) for p in self.pairs]
        return SweptScene(self.coordinates.tree, self.bodies, pairs)

    @property
    def sweeper(self) -> Sweeper:
        """Proofs of motions, to :data:`OPEN`."""
        if "all" not in self.sweepers:
            self.sweepers["all"] = Sweeper(SweptScene(self.coordinates.tree, self.bodies, self.pairs))
        return self.sweepers["all"]

    def nearest(self, x: Array) -> Nearest | None:
        """The pair of the least margin at x; None where there is no pair."""
        if not self.pairs:
            return None
        still = Motion.linear(self.coordinates.tree, [0.0, 1.0], np.array([x, x]))
        return self.sweeper.sweep(still, aim="least", tolerance=1e-6, far=np.inf).nearest

    def violation(self, motion: Motion) -> Nearest | None:
        """Where two bodies are nearer than they may be during a motion, or where that is not proven; None: nowhere."""
        if not self.pairs:
            return None
        swept = self.sweeper.sweep(motion, aim="any", tolerance=OPEN)
        return None if swept.clear else swept.nearest
