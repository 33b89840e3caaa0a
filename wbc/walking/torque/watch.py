"""What is seen of a plant while a walk goes over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.multibody import pin
from wbc.robots import HoldRating
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.torque.loads import Loads
from wbc.walking.torque.tested import Tested


class Watch:
    """The worst of every tick of torques; of places and momentum the worst at the end of every period.

    Attributes:
        drift: farthest that a held frame was from where its grip closed [m]. force, moment: largest components of a
            grip's wrench [N], [N m]. given: largest components of the momentum given to the structure, linear [N s] and
            angular about the body's origin [N m s]. unsolved: ticks of torques that gave way or had no answer. noted:
            what the loop found wrong, (time [s], in words).
    """

    def __init__(self, model: pin.Model, rating: HoldRating, hands: Sequence[str]) -> None:
        self._model, self._data = model, model.createData()
        self.rating, self._hands = rating, tuple(hands)
        self.drift = self.force = self.moment = 0.0
        self.given = np.zeros(2)
        self.ticks = self.unsolved = 0
        self.noted: list[tuple[float, str]] = []
        # Of the period that goes on: its worst force, moment and distance of each hand; and all before it
        self._places: dict[str, Array] = {}
        self._now, self._rows = np.full((3, len(self._hands)), np.nan), list[tuple[float, Array, Array]]()

    def see(self, wrenches: Mapping[str, Array], status: str) -> None:
        """After a tick: what the grips exert on the robot, as of :attr:`Tested.wrenches`."""
        self.ticks += 1
        self.unsolved += status != "solved"
        for name, wrench in wrenches.items():
            sizes = np.abs(wrench)
            self._worst(name, slice(0, 2), (float(sizes[:3].max()), float(sizes[3:].max())))

    def grasps(self, plant: Tested, frame: str) -> None:
        """A hand has closed; one that slips is off where it did."""
        self._places[frame] = np.array(plant.grips[frame].pose.translation)
        self._off(plant.state.q)

    def releases(self, frame: str) -> None:
        """A hand opens, or its hold breaks off."""
        self._places.pop(frame, None)

    def period(self, plant: Tested) -> None:
        """A period of the walk is over."""
        state = plant.state
        self._off(state.q)
        given: Array = plant.given
        x, y, z = state.q[:3]
        a, b, c = given[:3]
        turning = given[3:] - (y * c - z * b, z * a - x * c, x * b - y * a)
        now = np.array([np.abs(given[:3]).max(), np.abs(turning).max()])
        self.given = np.maximum(self.given, now)
        self.force, self.moment, self.drift = np.fmax([self.force, self.moment, self.drift],
                                                      np.fmax.reduce(self._now, axis=1)).tolist()  # fmt: skip
        self._rows.append((state.time, self._now, now))
        self._now = np.full_like(self._now, np.nan)

    def _off(self, q: Array) -> None:
        model, data = self._model, self._data
        pin.framesForwardKinematics(model, data, q)
        for name, place in self._places.items():
            off = data.oMf[model.getFrameId(name)].translation - place
            self._worst(name, slice(2, 3), (float(np.sqrt(off @ off)),))

    def loads(self) -> Loads:
        """What was seen, period by period."""
        count = len(self._hands)
        worst = np.array([row for _, row, _ in self._rows]).reshape(-1, 3, count)
        given = np.array([row for _, _, row in self._rows]).reshape(-1, 2)
        time = np.array([time for time, _, _ in self._rows])
        force, moment, off = worst[:, 0], worst[:, 1], worst[:, 2]
        return Loads(time, force, moment, off, given, self.rating, tuple(self.noted))

    def _worst(self, name: str, rows: slice, values: tuple[float, ...]) -> None:
        at = self._hands.index(name)
        self._now[rows, at] = np.fmax(self._now[rows, at], values)

    def figures(self) -> tuple[Figure, ...]:
        """For the summary."""
        rating, given = self.rating, self.given.tolist()
        parts = self.force / rating.force, self.moment / rating.torque
        text = f"{self.force:.0f} N and {self.moment:.0f} N m, {parts[0]:.0%} and {parts[1]:.0%} of what a hold bears"
        return (
            Figure("grip_drift", "closed hand off its hold, in the plant", self.drift, f"{1e3 * self.drift:.2g} mm"),
            Figure("grip_wrench", "largest grip", {"force": self.force, "torque": self.moment}, text),
            Figure(
                "given",
                "momentum given to the structure",
                given,
                f"{given[0]:.1f} N s, {given[1]:.1f} N m s about the body",
            ),
            Figure("unsolved", "torques that gave way", self.unsolved, f"{self.unsolved} of {self.ticks} ticks"),
            Figure(
                "noted",
                "found wrong",
                [list(entry) for entry in self.noted],
                "; ".join(f"{text} at {time:.2f} s" for time, text in self.noted) or "nothing",
            ),
        )
