"""Where a robot's trunk and limbs should be, time by time: the one table that mapping, plan and ticks share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from scipy.spatial.transform import Rotation

from wbc.retarget.clip import Array, Marks
from wbc.rotations import continuous_quaternions

#: Points of a limb in the order of its chain
CHAIN = ("base", "middle", "wrist", "end")


class ContactGrip(Enum):
    """How a contact is held."""

    #: not at all
    FREE = 0
    #: along the ground that it lies on: its hull says how high it is
    LEVEL = 1
    #: in place
    FIRM = 2


@dataclass(frozen=True)
class Targets:
    """Targets of a body, in the world of the robot: its metres, the ground at z = 0.

    Attributes:
        limbs: of the robot, by name. dt: from one time to the next [s].
        pelvis: middle of the hips [times, 3] [m].
        chains: hip, knee, ankle and contact frame, or shoulder, elbow, wrist and hand [times, limbs, 4, 3] [m].
        turns: of ``pelvis``, ``chest``, ``head`` and limbs' ends, those that are known [times, 3, 3].
        stands: in stance. held: in stance or shortly before one. lies: a hand is on the ground there [times, limbs].
    """

    limbs: tuple[str, ...]
    dt: float
    pelvis: Array
    chains: Array
    turns: dict[str, Array]
    stands: Marks
    held: Marks
    lies: Marks

    def grips(self, time: int) -> dict[str, ContactGrip]:
        """How contacts of the limbs that are held are held."""
        marks = zip(self.limbs, self.held[time], self.lies[time], strict=True)
        return {name: ContactGrip.LEVEL if lies else ContactGrip.FIRM for name, held, lies in marks if held}

    @property
    def places(self) -> Array:
        """Pelvis and all points of chains, side by side [times, 1 + 4 limbs, 3] [m]."""
        return np.concatenate([self.pelvis[:, None], self.chains.reshape(len(self.pelvis), -1, 3)], axis=1)

    def at(self, times: Array) -> Targets:
        """The same at other times [s], by cubic splines; marks are those of the nearest time."""
        count, marks = len(self.pelvis), (self.stands, self.held, self.lies)
        nearest = np.clip(np.rint(times / self.dt).astype(int), 0, count - 1)
        places, turns = self.places, np.stack(list(self.turns.values()), axis=1)
        if count < 4:
            places, turns = places[nearest], turns[nearest]
        elif len(times) != count or not np.allclose(times, np.arange(count) * self.dt, atol=1e-9):
            from scipy.interpolate import CubicSpline

            quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat().reshape(count, -1, 4)
            for number in range(quaternions.shape[1]):
                quaternions[:, number] = continuous_quaternions(quaternions[:, number])
            own = np.arange(count) * self.dt
            places, quaternions = (CubicSpline(own, values, axis=0)(times) for values in (places, quaternions))
            turns = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix().reshape(len(times), -1, 3, 3)
        stands, held, lies = (values[nearest] for values in marks)
        return replace(
            self, dt=float(times[1] - times[0]) if len(times) > 1 else self.dt,
            pelvis=places[:, 0], chains=places[:, 1:].reshape(len(times), -1, 4, 3),
            turns=dict(zip(self.turns, turns.swapaxes(0, 1), strict=True)), stands=stands, held=held, lies=lies,
        )  # fmt: skip
