"""Pairs in blocks: all of a scene's pairs, and balls in which all is that a frame carries."""

from __future__ import annotations

import numpy as np
import pytest

from tests.clearance.test_sweeps import machine
from tests.clearance.world import random_arms, random_pose
from wbc.clearance import Pair, SweptBody, SweptScene, blocks
from wbc.clearance.blocks import in_blocks
from wbc.shapes import Sphere


def test_blocks_hold_what_their_pairs_are_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks, "MANY", 0)
    rng = np.random.default_rng(3)
    one = machine(rng, random_arms(rng))
    more = [SweptBody(f"{body.name} more", Sphere(0.1), body.link, random_pose(rng, 0.2)) for body in one.bodies]
    pairs = [*one.pairs, *(Pair(f"{pair.first} more", pair.second, 0.03) for pair in one.pairs)]
    scene = SweptScene(one.tree, [*one.bodies, *more], pairs)
    blocked, ends = in_blocks(scene.tree, scene.bodies, scene.pairs)
    count = len(scene.pairs)
    assert sorted(map(str, blocked.pairs[:count])) == sorted(map(str, scene.pairs))
    assert ends[-1] == count
    assert len(ends) == len(blocked.pairs) - count <= count / 2
    for block, (begin, end) in enumerate(zip([0, *ends], ends, strict=False)):
        whole = count + block
        held = {int(blocked.first[whole]), int(blocked.second[whole])}
        for pair in range(begin, end):
            assert blocked.required[whole] >= blocked.required[pair]
            assert sorted(blocked.stops[whole]) == sorted(blocked.stops[pair])
            for body in (int(blocked.first[pair]), int(blocked.second[pair])):
                holder = body if body in held else next(k for k in held if blocked.frame[k] == blocked.frame[body])
                inner, outer = blocked.line[body], blocked.line[holder]
                for tip in (inner[:3], inner[3:6]) if holder != body else ():
                    assert np.linalg.norm(tip - outer[:3]) + inner[6] <= outer[6]
