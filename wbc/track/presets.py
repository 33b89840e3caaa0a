"""Paths by name, built around the pose that the hand starts from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc import shapes, validation
from wbc.multibody import pin
from wbc.track.path import Sample, SplinePath, TimedPath, smooth_step
from wbc.validation import Array


class ClosedCurve:
    """A closed curve x(phi) about a start pose, phi = 2 pi laps x quintic step of t; the orientation stays.

        p(t) = p_start + u x1(phi) + w x2(phi),    twist = (dx/dphi dphi/dt, 0)

    with u, w the y and z axes of the world, so that the curve faces an arm that stands at the origin and looks along x.
    """

    def __init__(
        self, start: pin.SE3, duration: float, laps: int, curve: Callable[[float], tuple[Array, Array]]
    ) -> None:
        self._start = start
        self._duration = duration
        self._turns = 2.0 * math.pi * laps
        self._curve = curve

    @property
    def duration(self) -> float:
        return self._duration

    def sample(self, t: float) -> Sample:
        part, rate = smooth_step(t, self._duration)
        point, slope = self._curve(self._turns * part)
        linear = slope * (self._turns * rate)
        pose = pin.SE3(self._start.rotation.copy(), self._start.translation + np.array([0.0, *point]))
        return Sample(pose, np.array([0.0, *linear, 0.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)
class Preset:
    """A path, and the obstacles that it was made for: (sphere, position) pairs."""

    path: TimedPath
    obstacles: tuple[tuple[shapes.Sphere, Array], ...] = ()


def circle(start: pin.SE3, duration: float, size: float) -> Preset:
    """A circle of radius ``size`` in the plane x = const, begun at its lowest point, one lap."""

    def curve(phi: float) -> tuple[Array, Array]:
        return (
            size * np.array([math.sin(phi), 1.0 - math.cos(phi)]),
            size * np.array([math.cos(phi), math.sin(phi)]),
        )

    return Preset(ClosedCurve(start, duration, 1, curve))


def figure_eight(start: pin.SE3, duration: float, size: float) -> Preset:
    """A lemniscate of Gerono of half width ``size`` in the plane x = const, begun at its middle."""

    def curve(phi: float) -> tuple[Array, Array]:
        return (
            size * np.array([math.sin(phi), math.sin(phi) * math.cos(phi)]),
            size * np.array([math.cos(phi), math.cos(2.0 * phi)]),
        )

    return Preset(ClosedCurve(start, duration, 1, curve))


def line(start: pin.SE3, duration: float, size: float) -> Preset:
    """Straight to a point ``size`` along the world's y axis and back, at rest in between."""
    there = pin.SE3(start.rotation, start.translation + np.array([0.0, size, 0.0]))
    return Preset(_There(SplinePath([0.0, duration / 2], [start, there])))


class _There:
    """A path, then the same backwards."""

    def __init__(self, path: SplinePath) -> None:
        self._path = path

    @property
    def duration(self) -> float:
        return 2.0 * self._path.duration

    def sample(self, t: float) -> Sample:
        if t <= self._path.duration:
            return self._path.sample(t)
        back = self._path.sample(self.duration - t)
        return Sample(back.pose, -back.twist)


def around_obstacle(start: pin.SE3, duration: float, size: float) -> Preset:
    """To the other side of a sphere of radius ``size``, round it in front, and back along the same path.

    With s the start position and r = size, the far end is s + (0, -7 r, 0), so the straight line passes through the
    sphere at s + (-r/3, -7 r/2, 0), and the path goes by s + (2 r/3 + 0.1 m, -7 r/2, 0) instead. The hand turns by
    -0.6 rad about the world's z axis until there. The spline is at rest only at the start and at the end.
    """
    across = 7.0 * size

    def pose(x: float, y: float, yaw: float) -> pin.SE3:
        turn = np.array(pin.AngleAxis(yaw, np.array([0.0, 0.0, 1.0])).matrix())
        return pin.SE3(turn @ start.rotation, start.translation + np.array([x, y, 0.0]))

    front, far = pose(2.0 * size / 3.0 + 0.1, -across / 2, -0.3), pose(0.0, -across, -0.6)
    path = SplinePath(np.linspace(0.0, duration, 5), [start, front, far, front, start])
    center = start.translation + np.array([-size / 3, -across / 2, 0.0])
    return Preset(path, ((shapes.Sphere(size), center),))


#: Name -> builder of a preset (start pose, duration [s], size [m]) and the size it has if none is given.
PRESETS: dict[str, tuple[Callable[[pin.SE3, float, float], Preset], float]] = {
    "around-obstacle": (around_obstacle, 0.06),
    "circle": (circle, 0.1),
    "figure-eight": (figure_eight, 0.15),
    "line": (line, 0.3),
}


def preset(name: str, start: pin.SE3, duration: float, size: float | None = None) -> Preset:
    """A path by name, from a start pose.

    Args:
        name: one of :data:`PRESETS`.
        start: the hand's pose in the world.
        duration: > 0 [s].
        size: > 0 [m]; see the presets. Default: the preset's own.

    Raises:
        UnknownNameError: no such preset. RangeError, ShapeError, NotFiniteError: bad numbers.
    """
    build, usual = PRESETS[validation.one_of("path", name, PRESETS)]
    length = validation.scalar("size", usual if size is None else size, low=0.0, open_low=True, unit="m")
    time = validation.scalar("duration", duration, low=0.0, open_low=True, unit="s")
    return build(validation.pose("start", start), time, length)
