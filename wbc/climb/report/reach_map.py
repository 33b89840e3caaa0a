"""A map of footholds: which limbs reach each of them from somewhere along a climb."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.climb.climber import Climber
from wbc.climb.loop import ClimbRun
from wbc.climb.reach import LimbReach
from wbc.climb.report import surroundings
from wbc.climb.report.pictures import PICTURE_SIZE, ClimbPictures
from wbc.climb.report.surroundings import limb_colour, mixed
from wbc.climb.scene import ClimbScene
from wbc.climb.world import TURNS
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Poses of the body that are looked at, at most
SAMPLES = 12
#: Height that the map is seen from [rad]
HIGH = 1.2
#: Radius of a foothold of the map, in that of one in pictures [1]
LARGE = 2.2
#: Corners of a whole disc
ROUND = 24


def footholds_in_reach(climber: Climber, scene: ClimbScene, poses: Sequence[pin.SE3]) -> NDArray[np.bool_]:
    """Which footholds each limb reaches, within its joints' limits, from one of some poses of the body or another
    ``(footholds, limbs)``. Bodies in the way and what the limb can bear are not looked at.
    """
    reach, out = LimbReach(climber), np.zeros((len(scene.footholds), len(climber.limbs)), dtype=bool)
    for limb, own in enumerate(climber.limbs):
        turning = climber.fixed(limb) == "pose"
        wanted, rows = list[pin.SE3](), list[int]()
        for row, foothold in enumerate(scene.footholds):
            if foothold.limbs and own.name not in foothold.limbs:
                continue
            turns = (foothold.rolls or TURNS) if turning else 1
            spins = [pin.SE3(pin.utils.rotate("z", 2.0 * np.pi * k / turns), np.zeros(3)) for k in range(turns)]
            wanted += [own.contact.held_at(foothold.pose) * spin for spin in spins]
            rows += [row] * turns
        for body in poses if wanted else ():
            _, solved = reach.postures(limb, np.array([place(body.actInv(pose)) for pose in wanted]))
            out[np.array(rows)[solved[:, 0]], limb] = True
    return out


def save_reach_map(run: ClimbRun, file: pathlib.Path) -> pathlib.Path:
    """Draws the footholds near a climb, each a disc of as many sectors as there are limbs: those of limbs that reach it
    are in their colours; larger discs were held.
    """
    drawn, climber, scene = ClimbPictures(run), run.plans[0].climber, run.scene
    samples = np.unique(np.linspace(0, len(run.log) - 1, SAMPLES).round().astype(int))
    reached = footholds_in_reach(climber, scene, [climber.body_pose(q) for q in run.log.array("q")[samples]])
    held = {int(row) for row in np.unique(run.log.array("contact"))}
    picture = drawn.begin({}, bodies_only=True)
    for limb, own in enumerate(climber.limbs):
        sectors = [
            _sector(
                scene.footholds[row].pose,
                drawn.stud * (1.3 * LARGE if row in held else LARGE),
                limb,
                len(climber.limbs),
            )
            for row in drawn.near.tolist()
            if reached[row, limb]
        ]
        if sectors:
            picture.add_triangles(
                np.concatenate(sectors) @ drawn.turn.T, f"{own.name}: {int(reached[:, limb].sum())}",
                mixed(limb_colour(limb), 0.0),
            )  # fmt: skip
    none = [row for row in drawn.near.tolist() if not reached[row].any()]
    if none:
        studs = surroundings.stud_triangles(scene, none, drawn.stud)
        picture.add_triangles(studs @ drawn.turn.T, f"out of reach: {len(none)}", surroundings.FREE)
    drawn.add_way(picture)
    height = drawn.elevation if drawn.on_wall else HIGH
    return picture.save(file, PICTURE_SIZE, drawn.azimuth, height, drawn.around)


def _sector(pose: pin.SE3, radius: float, limb: int, limbs: int) -> Array:
    """The part of a disc that is a limb's ``(m, 3, 3)`` [m]."""
    angle = 2.0 * np.pi * (limb + np.linspace(0.0, 1.0, ROUND // limbs + 2)) / limbs
    ring = radius * np.stack([np.cos(angle), np.sin(angle), np.full(len(angle), surroundings.TALL / LARGE)], axis=1)
    middle = np.broadcast_to([0.0, 0.0, radius * surroundings.TALL / LARGE], ring[1:].shape)
    return np.asarray(np.stack([middle, ring[:-1], ring[1:]], axis=1) @ pose.rotation.T + pose.translation)
