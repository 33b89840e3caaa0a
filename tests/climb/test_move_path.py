"""Paths of single moves, of postures drawn from seeds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.climb.closure import Closure
from wbc.climb.elastic_band import ElasticBand
from wbc.climb.machines import climber
from wbc.climb.move_path import LIFTING, SwingShape, band_path, move_path
from wbc.climb.scene import ClimbScene, Foothold
from wbc.climb.stance import Stance
from wbc.climb.world import ClimbWorld
from wbc.errors import InfeasibleError

#: Pairs of postures of a limb
PAIRS = 40
#: How far a limb is lifted [m]
HEIGHT = 0.1


def test_a_hand_that_cannot_keep_its_turn_goes_on_with_its_turn_free() -> None:
    robot = climber("walker")
    closure, rng, made = Closure(robot), np.random.default_rng(0), 0
    rest, (low, high) = robot.angles(robot.rest, 0), robot.limits[0]
    room = 0.1 * np.minimum(high - low, 3.0)
    for _ in range(PAIRS):
        drawn = [np.clip(rest + rng.uniform(-0.8, 0.8, len(rest)), low + room, high - room) for _ in range(2)]
        one, other = (
            Stance((first, 1, 2), robot.with_limb(robot.rest, 0, angles))
            for first, angles in zip((0, 3), drawn, strict=True)
        )
        leaves, lands = closure.poses(one.q), closure.poses(other.q)[0]
        normals = {row: pose.rotation[:, 2] for row, pose in enumerate([*leaves, lands])}
        scene = ClimbScene([Foothold(str(row), pose) for row, pose in enumerate([*leaves, lands])])
        shape, band = SwingShape(HEIGHT), ElasticBand(ClimbWorld(robot, scene))
        try:
            guide = band_path(closure, one, other, shape, normals, band)
            path = move_path(closure, one, other, replace(shape, guide=guide), normals)
        except InfeasibleError:
            continue
        made += 1
        np.testing.assert_allclose(path.q[[0, -1]], [one.q, other.q])
        assert path.error < 2e-5
        # It leaves along the normal and lands along it, its axis as it was at the foothold
        for share, pose in ((0.25, leaves[0]), (1.0, leaves[0]), (1.0, lands), (0.25, lands)):
            s = LIFTING * share if pose is leaves[0] else 1.0 - LIFTING * share
            at = closure.poses(path.configurations(path.at(np.array([s])))[0])[0]
            wanted = pose.translation + share * HEIGHT * pose.rotation[:, 2]
            np.testing.assert_allclose(at.translation, wanted, atol=1e-3)
            if share < 1.0:
                assert at.rotation[:, 2] @ pose.rotation[:, 2] > 1.0 - 1e-3
    assert made > 0.7 * PAIRS
