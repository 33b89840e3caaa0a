"""Pictures of capsules in front of something that stands still, quick enough for a film.

Each pixel's ray meets a capsule (Inigo Quilez, "capsule intersection"): with the core from a along ba, the ray
o + s d and oa = o - a, first the cylinder

    (ba.ba - (ba.d)^2) s^2 + 2 (ba.ba d.oa - ba.oa ba.d) s + ba.ba oa.oa - (ba.oa)^2 - r^2 ba.ba = 0

and where that is met beyond an end of the core, the ball about that end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.track import render
from wbc.validation import Array

#: Rays along each side of a pixel
RAYS = 2


@dataclass(frozen=True, eq=False)
class Capsules:
    """k capsules: ends of their cores [k, 3] [m], radii [k] [m], colours [k, 3] in 0..1."""

    first: Array
    last: Array
    radii: Array
    colours: Array


class Ground:
    """What stands still, drawn once with its depth.

    Args:
        camera: of the picture. meshes: what stands still.
    """

    def __init__(self, camera: render.Camera, meshes: list[render.ColouredMesh]) -> None:
        self._fine = render.Camera(camera.eye, camera.target, camera.view, RAYS * camera.width, RAYS * camera.height)
        layer = render.draw(meshes, self._fine)
        seen, colours = render.shade(layer, self._fine, None)
        self._image = np.ones((self._fine.height, self._fine.width, 3), dtype=np.float32)
        self._image[seen] = colours
        self._depth = layer.depth.astype(np.float32)
        self._flat = _bytes(self._image)

    def over(self, capsules: Capsules) -> NDArray[np.uint8]:
        """The picture with capsules in it, [height, width, 3]."""
        boxes = [_box(self._fine, *ends) for ends in zip(capsules.first, capsules.last, capsules.radii, strict=True)]
        left, top = (RAYS * (min(box[k] for box in boxes) // RAYS) for k in (0, 1))
        right, bottom = (-RAYS * (-max(box[k] for box in boxes) // RAYS) for k in (2, 3))
        if right <= left or bottom <= top:
            return self._flat
        window = np.s_[top:bottom, left:right]
        image, depth = self._image[window].copy(), self._depth[window].copy()
        for k, (x0, y0, x1, y1) in enumerate(boxes):
            if x1 > x0 and y1 > y0:
                part = np.s_[y0 - top : y1 - top, x0 - left : x1 - left]
                _draw(self._fine, (x0, y0, x1, y1), capsules, k, image[part], depth[part])
        out = self._flat.copy()
        place = np.s_[top // RAYS : bottom // RAYS, left // RAYS : right // RAYS]
        out[place] = _bytes(image)
        return out


def _bytes(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Means over the rays of a pixel, 0 to 255."""
    h, w = image.shape[0] // RAYS, image.shape[1] // RAYS
    means = image.reshape(h, RAYS, w, RAYS, 3).mean(axis=(1, 3))
    out: NDArray[np.uint8] = (255.0 * np.clip(means, 0.0, 1.0) + 0.5).astype(np.uint8)
    return out


def _box(camera: render.Camera, first: Array, last: Array, radius: float) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of the pixels that a capsule may cover."""
    screen = camera.project(np.stack([first, last]))
    wide = 1.05 * camera.focal * radius / max(float(screen[:, 2].min()) - radius, 1e-3) + 2.0
    low, high = screen[:, :2].min(axis=0) - wide, screen[:, :2].max(axis=0) + wide
    size = np.array([camera.width, camera.height])
    a, b = np.clip(low, 0, size).astype(int), np.clip(high + 1, 0, size).astype(int)
    return int(a[0]), int(a[1]), int(b[0]), int(b[1])


def _draw(
    camera: render.Camera,
    box: tuple[int, int, int, int],
    capsules: Capsules,
    which: int,
    image: NDArray[np.float32],
    depth: NDArray[np.float32],
) -> None:
    """Draws one capsule into a window of the picture, where it is nearer than what is there."""
    rays = _rays(camera, box)
    a, radius = capsules.first[which], float(capsules.radii[which])
    along, normal = _meet(camera.eye, rays, a, capsules.last[which] - a, radius)
    # Rays have the length 1 along the view, so that the way along them is the depth
    nearer = along < depth
    ray, up = rays[nearer], normal[nearer]
    view = -ray / np.linalg.norm(ray, axis=1, keepdims=True)
    half = render.LIGHT + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.clip((up * half).sum(axis=1), 0.0, 1.0) ** 40
    light = 0.43 + 0.13 * up[:, 2] + 0.52 * np.clip(up @ render.LIGHT, 0.0, 1.0)
    image[nearer] = capsules.colours[which] * light[:, None] + 0.16 * shine[:, None]
    depth[nearer] = along[nearer]


def _rays(camera: render.Camera, box: tuple[int, int, int, int]) -> Array:
    """Rays through a box of pixels, of length 1 along the view, [rows, columns, 3]."""
    x = (np.arange(box[0], box[2]) + 0.5 - camera.width / 2) / camera.focal
    y = (camera.height / 2 - np.arange(box[1], box[3]) - 0.5) / camera.focal
    right, up, back = camera.axes
    return np.asarray(x[None, :, None] * right + y[:, None, None] * up - back)


def _meet(eye: Array, rays: Array, a: Array, core: Array, radius: float) -> tuple[Array, Array]:
    """(way along rays to a capsule, inf where it is missed; outward normals)."""
    oa, square = eye - a, max(float(core @ core), 1e-12)
    rr, bd, dd = rays @ oa, rays @ core, (rays * rays).sum(axis=-1)
    bo = float(core @ oa)
    second = square * dd - bd * bd
    first = square * rr - bo * bd
    zeroth = square * float(oa @ oa) - bo * bo - radius**2 * square
    with np.errstate(invalid="ignore", divide="ignore"):
        way = (-first - np.sqrt(first * first - second * zeroth)) / second
        height = bo + way * bd
        # Beyond an end of the core, or looking along it: the ball about the nearer end
        end = np.where(np.isfinite(height), height > 0.0, bd < 0.0).astype(float)[..., None]
        centre = oa - end * core
        rc = (rays * centre).sum(axis=-1)
        ball = (-rc - np.sqrt(rc * rc - dd * ((centre * centre).sum(axis=-1) - radius**2))) / dd
        inside = (height > 0.0) & (height < square)
        out = np.where(inside, way, ball)
    out = np.where(np.isfinite(out) & (out > 0.0), out, np.inf)
    place = oa + np.where(np.isfinite(out), out, 0.0)[..., None] * rays
    nearest = np.clip((place @ core) / square, 0.0, 1.0)[..., None] * core
    return out, (place - nearest) / radius
