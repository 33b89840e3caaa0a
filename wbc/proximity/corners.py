"""Rows for corners and ends of pairs that are close: what nearest points jump to.

A row for the nearest points of two bodies does not see the far end of an edge that lies along a face. Any point a of
body A and any point b of body B are at least as far apart as the bodies are,

    |b - a| >= distance,

so a row for |b - a| asks for nothing that the distance does not ask for: nothing that is allowed is forbidden. Here a
is a corner (the centre of a ball, for round ends) and b its nearest point of B, and the other way round. Of each pair
that is close the nearest of these have rows; for other pairs they are too far to matter (``native/corners.h``).

Corners are those of boxes and hulls, the centres of the balls at a capsule's ends, and points on a cylinder's rims;
spheres have none. Of a hull with many, in front of a half-space, they are those that a tilt by 0.1 rad in one of four
directions makes the lowest: to these the nearest point goes as the hull rolls. Hulls are not the other body of a
corner: that is a sphere, capsule, box, cylinder or half-space, whose nearest point has a closed form.
"""

from __future__ import annotations

#: Pairs farther apart than the margin and this share of the robot's characteristic length have no such rows.
NEAR = 0.05
