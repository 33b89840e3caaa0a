"""A climb's log as arrays, and where its contact frames are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.errors import ShapeError
from wbc.log import Log
from wbc.multibody import pin
from wbc.validation import Array

#: In a log: a limb that holds nothing
OPEN = -1


@dataclass(frozen=True, eq=False)
class Climbed:
    """What was logged of a climb.

    Attributes:
        climber: the robot. scene: what it climbed.
        t: times ``(n)`` [s]. q: configurations ``(n, nq)``. contacts: rows of footholds ``(n, limbs)``, or
            ``OPEN``.
        aims: rows of footholds that limbs are on their way to through the air ``(n, limbs)``, or ``OPEN``.
        wrenches: ``(n, limbs, 6)`` in the axes of the footholds, None of a log without torques [N, N m].
        presence: (row of a foothold, time, 1: it came, or 0: it vanished) ``(k, 3)`` [s].
    """

    climber: Climber
    scene: ClimbScene
    t: Array
    q: Array
    contacts: NDArray[np.intp]
    aims: NDArray[np.intp]
    wrenches: Array | None
    presence: Array

    @classmethod
    def of(cls, log: Log, climber: Climber, scene: ClimbScene) -> Climbed:
        """The columns of a log.

        Raises:
            ShapeError: they are not of this robot and scene.
        """
        names = [limb.name for limb in climber.limbs]
        q, v = log.array("q"), log.array("v")
        if q.shape[1:] != (climber.robot.nq,) or v.shape[1:] != (climber.robot.nv,):
            reason = f"expected q of {climber.robot.nq} and v of {climber.robot.nv} numbers, as {climber.name} has"
            raise ShapeError("log", [q.shape, v.shape], reason)
        if list(log.group("contact")) != names:
            raise ShapeError("log", list(log.group("contact")), f"expected contacts of {', '.join(names)}")
        if len(log) < 2:
            raise ShapeError("log", len(log), "expected two ticks or more")
        contacts, aims = (log.array(name).astype(np.intp) for name in ("contact", "aim"))
        aims = aims if aims.shape[1] else np.full_like(contacts, OPEN)
        for rows in (contacts, aims):
            if rows.min() < OPEN or rows.max() >= len(scene.footholds):
                raise ShapeError("log", int(rows.max()), f"the scene has {len(scene.footholds)} footholds")
        wrenches = log.array("wrench")
        known = wrenches.reshape(len(log), len(names), 6) if wrenches.shape[1] else None
        presence = np.asarray(log.tables.get("presence", np.zeros((0, 3))))
        return cls(climber, scene, log["t"], q, contacts, aims, known, presence)

    @cached_property
    def moved(self) -> Array:
        """q_{k+1} (-) q_k ``(n - 1, nv)``."""
        model = self.climber.robot.model
        return np.array([pin.difference(model, a, b) for a, b in zip(self.q, self.q[1:], strict=False)])

    @cached_property
    def tips(self) -> tuple[Array, Array]:
        """Positions ``(n, limbs, 3)`` and rotations ``(n, limbs, 3, 3)`` of the contact frames."""
        model = self.climber.robot.model
        data, limbs = model.createData(), self.climber.limbs
        frames = [model.getFrameId(limb.frame) for limb in limbs]
        places, turns = np.zeros((len(self.t), len(limbs), 3)), np.zeros((len(self.t), len(limbs), 3, 3))
        for k, q in enumerate(self.q):
            pin.forwardKinematics(model, data, q)
            for limb, frame in enumerate(frames):
                pose = pin.updateFramePlacement(model, data, frame) * limbs[limb].placement
                places[k, limb], turns[k, limb] = pose.translation, pose.rotation
        return places, turns

    @cached_property
    def body(self) -> Array:
        """Twists of the body between ticks in its own axes, linear first ``(n - 1, 6)`` [m/s, rad/s]."""
        poses = [self.climber.body_pose(q) for q in self.q]
        moved = [pin.log6(a.actInv(b)).vector for a, b in pairwise(poses)]
        return np.array(moved) / np.diff(self.t)[:, None]

    def stretches(self, limb: int) -> list[tuple[int, int, int]]:
        """(first tick, tick after the last, foothold or ``OPEN``) of a limb, one after another."""
        column = self.contacts[:, limb]
        cuts = [0, *(np.flatnonzero(np.diff(column)) + 1).tolist(), len(column)]
        return [(a, b, int(column[a])) for a, b in pairwise(cuts)]
