"""Where a function on a grid is zero, as triangles: marching tetrahedra."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from wbc.errors import ShapeError
from wbc.validation import Array

#: Corners of a cell that six tetrahedra about its diagonal have, each a walk along the axes in another order
_WALKS = np.array([[np.zeros(3), *np.cumsum(np.eye(3)[list(order)], axis=0)] for order in permutations(range(3))], int)
#: Corners of a tetrahedron, in the order of their values, between which the triangles have their vertices, by how many
#: values are negative
_TRIANGLES = {
    1: (((0, 1), (0, 2), (0, 3)),),
    2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
    3: (((3, 0), (3, 1), (3, 2)),),
}


def zero_surface(values: Array, ticks: Array) -> Array:
    """Triangles of the set f = 0, f linear in each of six tetrahedra a cell.

    Args:
        values: of f on the grid ticks x ticks x ticks ``[n, n, n]``. ticks: rising ``[n]``.

    Returns:
        ``[m, 3 vertices, 3 coordinates]``, counterclockwise seen from where f is positive.

    Raises:
        ShapeError: values that are not on that grid.
    """
    count = len(ticks)
    if values.shape != (count,) * 3 or count < 2:
        raise ShapeError("values", values, f"expected shape {(count,) * 3}, and two ticks or more")
    cells = np.stack(np.meshgrid(*[np.arange(count - 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 1, 3)
    corners = (cells + _WALKS).reshape(-1, 4, 3)
    # A corner at zero counts as above, so that every crossing has a length
    heights = values[corners[..., 0], corners[..., 1], corners[..., 2]]
    order = np.argsort(heights, axis=1)
    heights = np.take_along_axis(heights, order, axis=1)
    corners = np.take_along_axis(corners, order[..., None], axis=1)
    below = (heights < 0.0).sum(axis=1)
    pieces, upward = [], []
    for number, triangles in _TRIANGLES.items():
        h, at = heights[below == number], np.asarray(ticks)[corners[below == number]]
        for triangle in triangles:
            upward.append(at[:, 3] - at[:, 0])
            part = [h[:, a] / (h[:, a] - h[:, b]) for a, b in triangle]
            pieces.append(
                np.stack(
                    [at[:, a] + t[:, None] * (at[:, b] - at[:, a]) for (a, b), t in zip(triangle, part, strict=True)], 1
                )
            )
    out, normal = np.concatenate(pieces), np.concatenate(upward)
    turned = np.einsum("ij,ij->i", np.cross(out[:, 1] - out[:, 0], out[:, 2] - out[:, 0]), normal) < 0.0
    out[turned] = out[turned][:, [0, 2, 1]]
    return np.asarray(out)
