"""What a walker did, cycle by cycle, in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.published.three_arm_walker.gait.gait import Gait
from wbc.published.three_arm_walker.machine.grid import INCH, PITCH, STEP
from wbc.published.three_arm_walker.machine.motion import RATE
from wbc.published.three_arm_walker.machine.plant import WalkerPose
from wbc.published.three_arm_walker.machine.reach import ARMS
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class PublishedLog:
    """n cycles of 0.1 s, each as it begins.

    Attributes:
        times: n [s]. bodies: n x 4 x 4, hands: n x 3 x 4 x 4, in the frame of the structure [m].
        supporting: n x 3. places: n x 3 x 2, (T, A) held or targeted, 0 for none.
        commands: n x 3, speeds round (T) and along (A) the structure at the body [m/s], spin [rad/s].
    """

    times: Array
    bodies: Array
    hands: Array
    supporting: NDArray[np.bool_]
    places: NDArray[np.int64]
    commands: Array

    def part(self, rows: slice) -> PublishedLog:
        """Some of its cycles."""
        return PublishedLog(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


class WalkerRecorder:
    """Cycles in the source's units, collected."""

    def __init__(self) -> None:
        self.rows: list[tuple[Array, Array, list[bool], list[tuple[int, int]], Array]] = []

    def add(self, plant: WalkerPose, gait: Gait, rates: Array) -> None:
        """One cycle, with the rates of T and A [grid units/s] and the spin [rad/s] that are commanded."""
        places = [place or (0, 0) for place in gait.places]
        self.rows.append((plant.body.copy(), plant.hands.copy(), list(gait.supporting), places, rates))

    def log(self) -> PublishedLog:
        """All cycles."""
        n = len(self.rows)
        bodies = np.array([row[0] for row in self.rows]).reshape(n, 4, 4)
        hands = np.array([row[1] for row in self.rows]).reshape(n, ARMS, 4, 4)
        commands = np.array([row[4] for row in self.rows]).reshape(n, 3)
        commands[:, 0] *= STEP * np.hypot(bodies[:, 0, 3], bodies[:, 1, 3]) * INCH
        commands[:, 1] *= PITCH * INCH
        for poses in (bodies, hands):
            poses[..., :3, 3] *= INCH
        return PublishedLog(
            np.asarray(np.arange(n) / RATE),
            bodies,
            hands,
            np.array([row[2] for row in self.rows], dtype=bool).reshape(n, ARMS),
            np.array([row[3] for row in self.rows], dtype=np.int64).reshape(n, ARMS, 2),
            commands,
        )
