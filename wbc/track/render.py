"""The renderer of all pictures and films: triangles, depth buffer, one light with shadows, a floor.

It exists because a plotting library sorts whole surfaces by their distance, which draws an arm through itself. Plain
numpy, without a screen: a few seconds a still picture, a tenth of a second a picture of a film; it is no viewer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.shapes import PlacedShape
from wbc.validation import Array

#: Arrays of other kinds of numbers: single precision, indices, masks
Numbers = NDArray[Any]

#: Pixels that are filled at once: some tens of MB
AT_ONCE = 1_000_000
#: Side of the square shadow map [pixels]
SHADOW_MAP = 1200
#: Looks at the shadow map for each pixel
LOOKS = 8
#: Vertical angle of view [rad]
VIEW = math.radians(16.0)
#: Part of a picture's width or height that what it shows takes
FILLED = 0.90
LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])


@dataclass(frozen=True, eq=False)
class ColouredMesh:
    """Triangles in the world, m x 3 x 3 [m], of one colour (r, g, b in 0..1)."""

    triangles: Array
    colour: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera.

    Attributes:
        eye, target: where it is and what is in the middle of the picture [m]; z is up.
        view: vertical angle of view [rad].
        width, height: of the picture [pixels].
    """

    eye: Array
    target: Array
    view: float
    width: int
    height: int

    @property
    def axes(self) -> Array:
        """Rows: right, up and backward, in the world."""
        back = (self.eye - self.target) / np.linalg.norm(self.eye - self.target)
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(back, right), back])

    @property
    def focal(self) -> float:
        """Focal length [pixels]."""
        return float(self.height / (2.0 * math.tan(self.view / 2.0)))

    def project(self, points: Array) -> Array:
        """(column, row, distance along the view) of points, [..., 3]."""
        # One product of flat arrays: a stack of small ones takes ten times as long
        local = points.reshape(-1, 3) @ self.axes.T - self.axes @ self.eye
        depth = -local[:, 2]
        scale = self.focal / np.maximum(depth, 1e-6)
        out = np.empty_like(local)
        out[:, 0] = self.width / 2.0 + scale * local[:, 0]
        out[:, 1] = self.height / 2.0 - scale * local[:, 1]
        out[:, 2] = depth
        return out.reshape(points.shape)

    def rays(self, mask: Numbers | None = None) -> Array:
        """Directions through the pixels' middles, of depth 1: height x width x 3, or n x 3 for those of a mask."""
        x = (np.arange(self.width) + 0.5 - self.width / 2.0) / self.focal
        y = (self.height / 2.0 - np.arange(self.height) - 0.5) / self.focal
        if mask is None:
            local = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)
        else:
            rows, columns = np.nonzero(mask)
            local = np.stack([x[columns], y[rows], np.full(len(rows), -1.0)], axis=-1)
        return np.asarray(local @ self.axes)


@dataclass(frozen=True, eq=False)
class Layer:
    """What is visible at each pixel of one set of meshes.

    Attributes:
        depth: distance along the view [m], inf where nothing is; height x width.
        owner: number of the triangle, -1 where nothing is; height x width.
        normals, colours: of the triangles, m x 3.
    """

    depth: Numbers
    owner: Numbers
    normals: Array
    colours: Array


def framed(
    points: Array, size: tuple[int, int], azimuth: float, elevation: float, view: float = VIEW, filled: float = FILLED
) -> Camera:
    """A camera that looks so that points, n x 3 [m], fill the picture.

    Args:
        size: width and height [pixels]. azimuth, elevation: side and height that they are seen from [rad].
        view: vertical angle of view [rad]. filled: part of the picture's width or height that they take.
    """
    flat, middle = math.cos(elevation), np.array(size) / 2
    direction = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])
    target, distance = points.mean(axis=0), 8.0
    for _ in range(6):
        camera = Camera(target + distance * direction, target, view, *size)
        screen = camera.project(points)[:, :2]
        low, high = screen.min(axis=0), screen.max(axis=0)
        off = (low + high) / 2 - middle
        right, up, _ = camera.axes
        target = target + (off[0] * right - off[1] * up) * distance / camera.focal
        distance *= float(np.max((high - low) / (2.0 * filled * middle)))
    return Camera(target + distance * direction, target, view, *size)


def draw(meshes: Sequence[ColouredMesh], camera: Camera) -> Layer:
    """The nearest surfaces."""
    nearness = np.full(camera.width * camera.height, np.inf, dtype=np.float32)
    owner = np.full(camera.width * camera.height, -1, dtype=np.int64)
    every = np.concatenate([np.zeros((0, 3, 3)), *(mesh.triangles for mesh in meshes)])
    shades = np.array([mesh.colour for mesh in meshes]).reshape(-1, 3)
    colours = np.repeat(shades, [len(mesh.triangles) for mesh in meshes], axis=0)
    screen = camera.project(every)
    ahead = np.flatnonzero((screen[..., 2] > 0.05).all(axis=1))
    screen = screen[ahead]
    # In a picture with perspective the inverse of depth is linear, not depth
    screen[..., 2] = -1.0 / screen[..., 2]
    _fill(screen, ahead, nearness, owner, camera.width, camera.height)
    normals = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    depth, shape = np.where(owner >= 0, -1.0 / nearness, np.inf), (camera.height, camera.width)
    return Layer(depth.reshape(shape), owner.reshape(shape), normals, colours)


class Shadows:
    """Depth of the scene as seen from the light (parallel rays)."""

    def __init__(self, meshes: Sequence[ColouredMesh]) -> None:
        side = np.cross([0.0, 0.0, 1.0], LIGHT)
        side /= np.linalg.norm(side)
        self._axes = np.array([side, np.cross(LIGHT, side), -LIGHT])
        every = np.concatenate([m.triangles for m in meshes])
        every = (every.reshape(-1, 3) @ self._axes.T).reshape(every.shape)
        low, high = every[..., :2].reshape(-1, 2).min(axis=0), every[..., :2].reshape(-1, 2).max(axis=0)
        self._origin, self._scale = low - 0.02, (SHADOW_MAP - 1) / float((high - low).max() + 0.04)
        screen = every.copy()
        screen[..., :2] = (screen[..., :2] - self._origin) * self._scale
        depth = np.full(SHADOW_MAP**2, np.inf, dtype=np.float32)
        owner = np.full(SHADOW_MAP**2, -1, dtype=np.int64)
        _fill(screen, np.arange(len(screen)), depth, owner, SHADOW_MAP, SHADOW_MAP)
        self._depth = depth.reshape(SHADOW_MAP, SHADOW_MAP)

    def lit(self, points: Array, softness: float) -> Array:
        """Part of the light that reaches points [..., 3], 0 to 1; ``softness`` is the blur of edges [m]."""
        local = points @ self._axes.T
        place = ((local[:, :2] - self._origin) * self._scale).astype(np.float32)
        reach = max(1.0, softness * self._scale)
        # Each pixel looks in directions of its own, so that few looks leave grain, which is averaged away, not bands
        turn = (2.0 * math.pi * ((0.7548776662 * np.arange(len(points))) % 1.0)).astype(np.float32)
        total = np.zeros(len(points))
        for k in range(LOOKS):
            away = reach * math.sqrt((k + 0.5) / LOOKS)
            angle = turn + 2.399963 * k
            column = np.clip((place[:, 0] + away * np.cos(angle)).astype(np.int32), 0, SHADOW_MAP - 1)
            row = np.clip((place[:, 1] + away * np.sin(angle)).astype(np.int32), 0, SHADOW_MAP - 1)
            total += local[:, 2] < self._depth[row, column] + 0.012
        return np.asarray(total / LOOKS)


def shade(layer: Layer, camera: Camera, shadows: Shadows | None) -> tuple[Numbers, Array]:
    """(mask of the pixels where something is seen, their colours): sky light, the light with shadows, a highlight."""
    seen = np.isfinite(layer.depth)
    rays = camera.rays(seen)
    points = camera.eye + rays * layer.depth[seen][:, None]
    view = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
    owner = layer.owner[seen]
    normal = layer.normals[owner]
    normal = np.where(np.sum(normal * view, axis=1, keepdims=True) < 0.0, -normal, normal)
    lambert = np.clip(normal @ LIGHT, 0.0, 1.0)
    lit = np.ones(len(points)) if shadows is None else shadows.lit(points + 0.006 * normal, 0.006)
    half = LIGHT + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.clip(np.sum(normal * half, axis=1), 0.0, 1.0) ** 40
    light = 0.43 + 0.13 * normal[:, 2] + 0.52 * lambert * lit
    return seen, np.clip(layer.colours[owner] * light[:, None] + (0.16 * shine * lit)[:, None], 0.0, 1.0)


class Backdrop:
    """What stands still in a film, drawn once with its depth on white.

    Args:
        meshes: what stands still. camera: of all pictures.
    """

    def __init__(self, meshes: Sequence[ColouredMesh], camera: Camera) -> None:
        self._camera, self._depth = camera, np.full((camera.height, camera.width), np.inf)
        self._image = np.ones((camera.height, camera.width, 3), dtype=np.float32)
        self._image, self._depth = self._drawn(meshes)

    def over(self, meshes: Sequence[ColouredMesh]) -> Numbers:
        """The picture with meshes before and behind what stands still, height x width x 3 in 0..1."""
        return self._drawn(meshes)[0]

    def _drawn(self, meshes: Sequence[ColouredMesh]) -> tuple[Numbers, Numbers]:
        layer = draw(meshes, self._camera)
        layer = replace(layer, depth=np.where(layer.depth < self._depth, layer.depth, np.inf))
        image = self._image.copy()
        seen, image[seen] = shade(layer, self._camera, None)
        return image, np.minimum(layer.depth, self._depth)


def floor(camera: Camera, shadows: Shadows, height: float, center: Array, radius: float) -> tuple[Array, Array]:
    """(colour, depth) of a pale floor at z = ``height`` with a grid of 0.25 m, fading into white at ``radius``."""
    every = camera.rays()
    with np.errstate(divide="ignore"):
        depth = (height - camera.eye[2]) / every[..., 2]
    depth = np.where((depth > 0.0) & np.isfinite(depth), depth, np.inf)
    colour = np.ones((*depth.shape, 3))
    reach = np.hypot(*(camera.eye[:2] - center[:2])) + 1.25 * radius
    close = depth < 1.5 * reach
    spot = camera.eye + every[close] * depth[close][:, None]
    near = np.clip(1.25 - np.linalg.norm(spot[:, :2] - center[:2], axis=1) / radius, 0.0, 1.0)
    near = near * near * (3.0 - 2.0 * near)
    lit = np.ones(len(spot))
    lit[near > 0] = shadows.lit(spot[near > 0], 0.03)
    width = np.maximum(depth[close] / camera.focal, 1e-9)
    lines = np.zeros(len(spot))
    for axis in (0, 1):
        off = np.abs((spot[:, axis] / 0.25 + 0.5) % 1.0 - 0.5) * 0.25
        lines = np.maximum(lines, np.clip(1.8 - off / width, 0.0, 1.0))
    tone = (0.95 - 0.05 * lines) * (0.68 + 0.32 * lit)
    colour[close] = 1.0 - near[:, None] * (1.0 - tone[:, None] * np.array([0.98, 0.988, 1.0]))
    return colour, depth


def occlusion(depth: Array, width: float) -> Array:
    """Darkening next to what stands in front, 0 to 1: the depth buffer against its own blur (Luft et al. 2006)."""
    from scipy.ndimage import gaussian_filter

    blurred = gaussian_filter(depth, width)
    return np.asarray(np.clip((depth - blurred) * 1.2, 0.0, 0.14))


def reduced(image: Array, factor: int) -> Array:
    """Means over blocks of factor x factor pixels."""
    h, w = factor * (image.shape[0] // factor), factor * (image.shape[1] // factor)
    # numpy adds a few large arrays many times faster than it takes means along short axes
    parts = [image[row:h:factor, column:w:factor] for row in range(factor) for column in range(factor)]
    return np.asarray(sum(parts[1:], start=parts[0].copy()) / factor**2)


def sphere(center: Array, radius: float, colour: tuple[float, float, float]) -> ColouredMesh:
    """A sphere of 64 x 32 faces."""
    polar, angles = np.linspace(0.0, math.pi, 65), np.array(_angles(128))
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(128)], axis=1)
    rings = np.sin(polar)[:, None, None] * around + np.cos(polar)[:, None, None] * np.array([0.0, 0.0, 1.0])
    return ColouredMesh(_quads(center + radius * rings), colour)


def tube(points: Array, radius: float, colour: tuple[float, float, float]) -> ColouredMesh:
    """A tube along a polyline, n x 3."""
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = int(run[-1] / max(radius, 1e-6)) + 1
    if count < 2:
        return ColouredMesh(np.zeros((0, 3, 3)), colour)
    # At equal distances along the path: where the robot is slow, recorded points are too close for a direction
    stations = np.linspace(0.0, run[-1], count)
    line = np.column_stack([np.interp(stations, run, points[:, k]) for k in range(3)])
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # Any direction that no piece of the line is parallel to
    side = np.cross(along, [0.31, 0.17, 0.93])
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    other = np.cross(along, side)
    angles = np.array(_angles(12))
    rings = line[:, None] + radius * (
        np.cos(angles)[:, None] * side[:, None] + np.sin(angles)[:, None] * other[:, None]
    )
    return ColouredMesh(_quads(rings), colour)


def _angles(count: int) -> list[float]:
    return [2.0 * math.pi * k / count for k in range(count)]


def _quads(rings: Array) -> Array:
    """Triangles between neighbouring rings of points, n x m x 3."""
    a, b = rings[:-1], rings[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    return np.concatenate(
        [np.stack([a, b, d], axis=2).reshape(-1, 3, 3), np.stack([a, d, c], axis=2).reshape(-1, 3, 3)]
    )


def _fill(screen: Array, names: Numbers, least: Numbers, owner: Numbers, width: int, height: int) -> None:
    """Keep, at each pixel whose middle lies in a triangle, the least third coordinate and whose it is."""
    low, high = _extremes(screen[..., 1])
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    rows = np.maximum(np.clip(np.floor(high - 0.5), -1, height - 1).astype(np.int64) - first + 1, 0)
    a, b, c = screen[:, 0], screen[:, 1] - screen[:, 0], screen[:, 2] - screen[:, 0]
    area = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    rows[np.abs(area) < 1e-9] = 0
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.stack([b[:, 2] * c[:, 1] - c[:, 2] * b[:, 1], c[:, 2] * b[:, 0] - b[:, 2] * c[:, 0]], axis=1)
        slope /= area[:, None]
    triangle, step = _each(rows)
    row = first[triangle] + step
    left, right = _crossings(screen[triangle], row + 0.5)
    start = np.clip(np.ceil(left - 0.5 - 1e-4), 0, width).astype(np.int64)
    count = np.maximum(np.clip(np.floor(right - 0.5 + 1e-4), -1, width - 1).astype(np.int64) - start + 1, 0)
    bottom, top = _extremes(screen[..., 2])
    for part in np.array_split(np.arange(len(row)), max(1, int(count.sum()) // AT_ONCE)):
        span, step = _each(count[part])
        span = part[span]
        who, x, y = triangle[span], start[span] + step, row[span]
        value = a[who, 2] + slope[who, 0] * (x + 0.5 - a[who, 0]) + slope[who, 1] * (y + 0.5 - a[who, 1])
        # A sliver's slope is as steep as it is thin
        value = np.clip(value, bottom[who], top[who]).astype(np.float32)
        pixel = y * width + x
        np.minimum.at(least, pixel, value)
        kept = value <= least[pixel]
        owner[pixel[kept]] = names[who[kept]]


def _extremes(corners: Array) -> tuple[Array, Array]:
    """Least and largest of three numbers, m x 3; much faster than along an axis."""
    a, b, c = corners.T
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _each(counts: Numbers) -> tuple[Numbers, Numbers]:
    """For each of ``counts[k]`` things of k: k, and its number among them."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _crossings(triangles: Array, y: Numbers) -> tuple[Array, Array]:
    """Leftmost and rightmost column of each triangle on a line at height y; (inf, -inf) where they do not meet."""
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for k in range(3):
        (x1, y1), (x2, y2) = triangles[:, k, :2].T, triangles[:, k - 1, :2].T
        with np.errstate(divide="ignore", invalid="ignore"):
            x = x1 + (y - y1) / (y2 - y1) * (x2 - x1)
        meets = (np.minimum(y1, y2) <= y) & (y <= np.maximum(y1, y2)) & (y1 != y2)
        left[meets] = np.minimum(left, x)[meets]
        right[meets] = np.maximum(right, x)[meets]
    return left, right


def triangles(placed: PlacedShape) -> Array:
    """The shape's surface in the link's frame, m x 3 x 3 [m]."""
    place: pin.SE3 = placed.placement
    return np.asarray(placed.shape.triangles() @ place.rotation.T + place.translation)
