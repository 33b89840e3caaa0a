"""The clips that other tests use keep what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from tests.retarget import clips


@pytest.mark.parametrize("name", [*clips.MOTIONS, "dog"])
@pytest.mark.parametrize("seed", range(2))
def test_stances_stand_still_and_bones_keep_their_lengths(name: str, seed: int) -> None:
    made = clips.dog(seed) if name == "dog" else clips.MOTIONS[name](seed)
    clip = made.clip
    for joint, parent in enumerate(clip.skeleton.parents):
        if parent >= 0:
            length = np.linalg.norm(clip.points[:, joint] - clip.points[:, parent], axis=1)
            assert np.abs(length - np.linalg.norm(clip.skeleton.offsets[joint])).max() < 1e-12
    for limb, stances in made.stances.items():
        place = clip.points[:, clip.skeleton.names.index(limb)]
        times = np.arange(len(place)) / clip.rate
        for stance in stances:
            standing = clips.standing_at(times, [stance])
            assert np.abs(place[standing] - stance.pose[:3]).max(initial=0.0) < 1e-12
    assert clip.points[:, :, 2].min() > 0.0
