"""What stands around a climber, for pages; and climbs as pages that play."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc.climb.climber import Climber
from wbc.climb.loop import ClimbRun
from wbc.climb.report import surroundings
from wbc.climb.scene import ClimbScene, size_of
from wbc.climb.stance import FREE_LIMB
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh, indexed
from wbc.viewer.runs import save_motion
from wbc.viewer.scenery import Scenery

#: A click counts for the foothold that it passes nearer than this, as a share of the shortest limb's reach
CLICK_WITHIN = 0.12
#: Bodies are drawn this far from the way of the body, as a share of that reach: a page can be turned to see them all
AROUND = 100.0


def save_climb_page(run: ClimbRun, file: pathlib.Path) -> pathlib.Path:
    """Write a climb as a page that plays in a browser; returns the file.

    Raises:
        MissingPackageError, ViewerError: as of :func:`wbc.viewer.runs.save_page`.
    """
    climber, scene, q = run.plans[0].climber, run.scene, run.log.array("q")
    contacts = run.log.array("contact").astype(int)
    notes = [{"held": [scene.footholds[k].id for k in row if k != FREE_LIMB]} for row in contacts.tolist()]
    scenery = scenery_of(climber, scene, q[len(q) // 2], contacts[len(q) // 2])
    return save_motion(climber.robot, run.log["t"], q, file, scenery=scenery, notes=notes)


def scenery_of(climber: Climber, scene: ClimbScene, q: Array, contacts: Array) -> Scenery:
    """Bodies and footholds round a climber at a configuration, which holds some of them, as rows."""
    reach, rows = size_of(climber), np.arange(len(scene.footholds))
    surfaces = list[DrawnMesh]()
    for triangles, colour in (
        (surroundings.surface_triangles(scene, rows, reach), surroundings.SURFACE),
        (surroundings.body_triangles(scene, np.array(q[None, :3]), AROUND * reach, rows.tolist()), surroundings.BODY),
    ):
        if len(triangles):
            surfaces.append(indexed(triangles, _bytes(colour)))
    up = surroundings.upwards(scene, [int(row) for row in contacts if row != FREE_LIMB])
    none = np.zeros((0, 3, 3))
    return Scenery(
        tuple(surfaces),
        indexed(surroundings.stud_triangles(scene, rows, surroundings.STUD * reach), _bytes(surroundings.FREE)),
        tuple(foothold.id for foothold in scene.footholds),
        np.array(scene.positions),
        (float(up[0]), float(up[1]), float(up[2])),
        climber.robot.model.names[1],
        tuple(limb.name for limb in climber.limbs),
        {link: (none, _bytes(colour)) for link, colour in surroundings.link_colours(climber).items()},
        CLICK_WITHIN * reach,
    )


def _bytes(colour: surroundings.Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in colour)
    return red, green, blue
