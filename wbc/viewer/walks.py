"""What stands around a walker, for pages; and walks as pages that play."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.shapes import PlacedShape
from wbc.track import render
from wbc.validation import Array
from wbc.viewer.bodies import OBSTACLE, Colour, DrawnMesh, Dress, indexed
from wbc.viewer.runs import save_motion
from wbc.viewer.scenery import Scenery
from wbc.walking.holds.structure import Structure
from wbc.walking.report import surroundings
from wbc.walking.report.parts import joining_pieces, link_colours
from wbc.walking.report.stills import held_by
from wbc.walking.run.recording import configuration
from wbc.walking.run.session import WalkRun

#: Colours of the structure and of its holds
SURFACE: Colour = (204, 213, 223)
STUD: Colour = (143, 153, 168)


def save_walk_page(run: WalkRun, file: pathlib.Path) -> list[pathlib.Path]:
    """Write a walk as a page that plays in a browser; returns the file, none where nothing was carried out.

    Raises:
        MissingPackageError, ViewerError: as of :func:`wbc.viewer.runs.save_page`.
    """
    log, walker = run.log, run.walker
    if log is None:
        return []
    places = [configuration(walker, log, row) for row in range(len(log))]
    notes = [{"held": [log.hold_id[hold] for hold in held_by(log, row)]} for row in range(len(log))]
    scenery = scenery_of(walker, run.structure, places[len(places) // 2])
    return [save_motion(walker.robot, log.t, places, file, scenery=scenery, notes=notes)]


def scenery_of(walker: Walker, structure: Structure, q: Array) -> Scenery:
    """Structure and holds under a walker at a configuration, from whose body up is seen."""
    rows = np.arange(len(structure))
    surfaces: list[DrawnMesh] = []
    for triangles, colour in (
        (surroundings.surface_triangles(structure, rows), SURFACE),
        (surroundings.obstacle_triangles(structure, rows), OBSTACLE),
    ):
        if len(triangles):
            surfaces.append(indexed(triangles, colour))
    up = [float(x) for x in -pin.XYZQUATToSE3(q[:7]).rotation[:, 2]]
    return Scenery(
        tuple(surfaces),
        indexed(surroundings.stud_triangles(structure, rows), STUD),
        tuple(structure.ids),
        np.array(structure.positions),
        (up[0], up[1], up[2]),
        "body",
        tuple(arm.name for arm in walker.arms),
        _dress(walker),
    )


def _dress(walker: Walker) -> Dress:
    """Arms in their colours, with the pieces that join their shapes."""
    colours = link_colours(walker)
    parts: dict[str, list[Array]] = {link: [np.zeros((0, 3, 3))] for link in colours}
    for piece in joining_pieces(walker, colours):
        parts.setdefault(piece.link, []).append(render.triangles(PlacedShape(piece.shape, piece.placement)))
        colours.setdefault(piece.link, piece.colour)
    bytes_of = {link: tuple(round(255 * part) for part in colour) for link, colour in colours.items()}
    return {link: (np.concatenate(parts[link]), (r, g, b)) for link, (r, g, b) in bytes_of.items()}
