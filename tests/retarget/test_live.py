"""Frames as they come: the same motion a frame later, feet that are held, and frames that are none."""

from __future__ import annotations

import numpy as np
import pytest

from tests.retarget import clips, motions
from wbc.errors import NotFiniteError, ShapeError
from wbc.retarget import Retargeter
from wbc.retarget.poses import frame_poses


def test_a_walk_as_it_comes() -> None:
    clip = motions.part(clips.walk().clip, 0.4, 3.4)
    made = Retargeter("g1", clip.skeleton)
    whole, live = made.run(clip), made.live(clip.rate)
    q = np.array([live.frame(p, t) for p, t in zip(clip.points, clip.turns, strict=True)])  # type: ignore[arg-type]
    assert np.abs(q[20:, 7:] - whole.q[19:-1, 7:]).mean() < 0.03
    feet = tuple(made.body.limbs[limb].end for limb in ("left_leg", "right_leg"))
    _, places = frame_poses(whole.robot, feet, q)
    assert places[:, :, 2].min() > -1e-3
    # Where both say that a foot stands it stays within half a millimetre, from the fifth frame of the stance on
    for k, limb in enumerate(("left_leg", "right_leg")):
        marks = whole.stance[limb]
        for a in range(10, len(q) - 12):
            if marks[a - 10 : a + 4].all():
                assert np.linalg.norm(places[a + 1, k] - places[a, k]) < 5e-4
    limits = whole.robot.limits
    v = np.diff(q[:, 7:], axis=0) * clip.rate
    assert (np.abs(v) <= limits.velocity[6:] * (1.0 + 1e-6)).all()


def test_a_frame_that_is_none_changes_nothing() -> None:
    clip = motions.part(clips.sit().clip, 0.0, 0.2)
    live = Retargeter("simple_humanoid", clip.skeleton).live(60.0)
    first = live.frame(clip.points[0])
    bad = clip.points[1].copy()
    bad[3, 1] = np.nan
    with pytest.raises(NotFiniteError, match="points"):
        live.frame(bad)
    with pytest.raises(ShapeError, match="points"):
        live.frame(clip.points[1][:4])
    with pytest.raises(ShapeError, match="every frame or in none"):
        live.frame(clip.points[1], clip.turns[1])  # type: ignore[index]
    assert live.q is not None
    assert np.array_equal(live.q, first)
    again = live.frame(clip.points[1])
    live.reset()
    assert live.q is None
    live.frame(clip.points[0])
    assert np.allclose(live.frame(clip.points[1]), again)
