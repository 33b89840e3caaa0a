"""Bases that roll without slip: which motions they have, the straight pieces of their paths, and how wheels follow."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from wbc.errors import CommandError
from wbc.robot import Robot
from wbc.validation import Array

#: Numbers of rows are 0, and ranks are told, within this share of the greatest
SAME = 1e-7
#: A path leads a base along one line where the directions of its pieces differ by no more than this
ALIGNED = 1e-6


@dataclass(frozen=True)
class RollingBase:
    """A planar base that turns about a point of it, or drives along a direction that is fixed in it (along any with
    rollers), while wheels follow its twist: W (v_x, v_y, w).

    Attributes:
        axle: (x, y) of the point in the base's axes [m]. heading: angle of the direction there [rad]; None: any.
        wheels: degrees of freedom that follow. follow: W, a row for each [rad/m, rad/m, 1].
    """

    axle: tuple[float, float]
    heading: float | None
    wheels: tuple[int, ...]
    follow: tuple[tuple[float, ...], ...]

    @classmethod
    def of_rows(cls, name: str, robot: Robot, samples: Array) -> RollingBase:
        """That of rows A v = 0 at several configurations [samples, rows, nv]; ``name`` of their items.

        Raises:
            CommandError: they leave other motions.
        """
        what, otherwise = f"rows of velocities on a {robot.base} base", "; plan without it"
        if robot.base not in ("planar", "differential"):
            raise CommandError(name, what, f"no path of configurations keeps rows of velocities{otherwise}")
        rows = samples.reshape(-1, robot.nv)
        least = SAME * max(1.0, float(np.abs(rows).max()))
        wheels = [k for k in range(3, robot.nv) if np.abs(rows[:, k]).max() > least]
        if np.linalg.matrix_rank(rows[:, wheels], least) < len(wheels):
            names = ", ".join(robot.dof_names[k] for k in wheels)
            raise CommandError(name, what, f"its velocities of {names} do not follow from the base's{otherwise}")
        follow = -np.linalg.pinv(rows[:, wheels], SAME) @ rows[:, :3]
        _, sizes, axes = np.linalg.svd(rows[:, :3] + rows[:, wheels] @ follow)
        (bx, by, turn), square = axes[0], float(axes[0][:2] @ axes[0][:2])
        if sizes[1] > least or (sizes[0] > least and square < SAME):
            reason = "it leaves no turns about a point of the base and drives along a direction that is fixed in it"
            raise CommandError(name, what, f"{reason}, as where wheels are steered{otherwise}")
        axle, heading = (0.0, 0.0), None
        if sizes[0] > least:
            axle = float(turn * by / square), float(-turn * bx / square)
            heading = float(np.arctan2(bx, -by) % np.pi)
        return cls(axle, heading, tuple(wheels), tuple(tuple(map(float, row)) for row in follow))

    def rates(self, limits: Array) -> Array:
        """Limits of the rates of the coordinates x, y and angle, of those of the base's own velocity [3]."""
        drives = (1.0, 1.0) if self.heading is None else (np.cos(self.heading), np.sin(self.heading))
        parts = np.abs([drives, self.axle[::-1]])
        drive, turn = np.where(parts > ALIGNED, limits[:2] / np.maximum(parts, ALIGNED), np.inf).min(axis=1)
        return np.array([drive / np.sqrt(2.0), drive / np.sqrt(2.0), min(limits[2], turn)])

    def at(self, angle: Any, math: ModuleType) -> tuple[Any, Any]:
        """Where the point is from the base's origin, along the world's axes, in numpy or CasADi [m]."""
        (x, y), cosine, sine = self.axle, math.cos(angle), math.sin(angle)
        return cosine * x - sine * y, sine * x + cosine * y

    def twist(self, angle: Array, rates: Array) -> Array:
        """The base's velocity along its own axes, where x, y and angle change at ``rates`` [3, ...]."""
        (along, across, turn), cosine, sine = rates, np.cos(angle), np.sin(angle)
        forwards, left = cosine * along + sine * across, cosine * across - sine * along
        return np.stack([forwards + self.axle[1] * turn, left - self.axle[0] * turn, turn])

    def rolled(self, points: Array, wheels: list[int]) -> Array:
        """The points of a path [points, n] with the wheels, whose numbers are given, as they follow from the first."""
        out, twist = points.copy(), self.twist(points[:-1, 2], np.diff(points[:, :3], axis=0).T)
        out[1:, wheels] = points[0, wheels] + np.cumsum((np.reshape(self.follow, (-1, 3)) @ twist).T, axis=0)
        return out

    def runs(self, points: Array) -> list[Array]:
        """Parts of a path on each of which x, y and angle stay on one line."""
        directions = np.diff(points[:, :3], axis=0)
        lengths = np.linalg.norm(directions, axis=1)
        line, first, out = None, 0, list[Array]()
        for k in np.flatnonzero(lengths > 0.0):
            now = directions[k] / lengths[k]
            if line is not None and np.linalg.norm(np.cross(now, line)) > ALIGNED:
                out.append(points[first : k + 1])
                first = int(k)
            line = now
        return [*out, points[first:]]


#: A base that turns about its origin and drives any way, without wheels
ANY_WAY = RollingBase((0.0, 0.0), None, (), ())
