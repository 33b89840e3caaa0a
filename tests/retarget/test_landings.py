"""A contact that comes late gives way to those that stand, and ticks that need no look are those of one at a time."""

from __future__ import annotations

import copy
import functools
from dataclasses import replace

import numpy as np
import pytest

from tests.retarget import clips, motions
from wbc.multibody import pin
from wbc.retarget import Retargeted, Retargeter, engine
from wbc.retarget.engine import Engine
from wbc.retarget.targets import Targets


@functools.cache
def seated() -> tuple[Engine, Retargeted]:
    """Who comes to sit with both feet on the ground, and the engine that made the motion."""
    made = Retargeter("simple_humanoid")
    motion = made.run(motions.part(clips.sit().clip, 0.0, 1.0))
    return made.engine(motion.plan.limbs, motion.plan.dt, head="head" in motion.plan.turns), motion


def reaching(motion: Retargeted, away: float) -> Targets:
    """The left hand stands so far to the left of where it is, from the first tick on, and is held from the tenth on."""
    plan, arm = copy.deepcopy(motion.plan), motion.plan.limbs.index("left_arm")
    _, positions = motions.places(motion, motion.body.limbs["left_arm"].end)
    plan.chains[:, arm, 3] = positions[len(positions) // 2] + np.array([0.0, away, 0.0])
    plan.stands[:, arm], plan.lies[:, arm] = True, False
    plan.held[:, arm] = np.arange(len(plan.held)) >= 10
    return plan


@pytest.mark.parametrize("away", [0.1, 0.2])
def test_a_hand_that_is_held_late_gives_way_to_the_feet(away: float, monkeypatch: pytest.MonkeyPatch) -> None:
    made, motion = seated()
    # It is held from farther away than a tick can bring it
    monkeypatch.setattr(engine, "HAND_ENGAGED", 1.0)
    q, gave = made.run(reaching(motion, away))
    assert gave == []
    for limb in ("left_leg", "right_leg"):
        feet = motions.places(replace(motion, q=q), motion.body.limbs[limb].end)[1]
        assert np.abs(feet - feet[0]).max() < 1e-6


@pytest.mark.parametrize("away", [(0.0, 1.2, 0.0), (1.5, 0.0, 0.0)])
def test_feet_stay_above_ground_where_they_cannot_all_stand(away: tuple[float, float, float]) -> None:
    """The left foot stands farther from the right one than legs reach; held there, one sinks by 5 to 11 cm."""
    made, motion = seated()
    far, leg = copy.deepcopy(motion.plan), motion.plan.limbs.index("left_leg")
    far.chains[:, leg, 3] += away
    far.stands[:, leg] = far.held[:, leg] = True
    q, gave = made.run(far)
    assert gave == []
    for limb in ("left_leg", "right_leg"):
        foot = motion.body.limbs[limb]
        rotations, positions = motions.places(replace(motion, q=q), foot.end)
        assert ((rotations[:, 2] @ foot.corners.T).min(axis=1) + positions[:, 2]).min() > -1e-3


def test_ticks_of_a_plan_are_those_of_one_at_a_time() -> None:
    made, motion = seated()
    places, turns = made.table(motion.plan)
    rows = made.rows(places, turns)
    q = np.empty((21, made.robot.nq))
    q[0] = made.start(places, turns, motion.plan.grips(0))
    v = made.controller.last_command
    made._ticks.most = np.inf
    assert made._ticks.run(rows[:20], q) == (20, None)
    made.controller.reset(q[0], v)
    for row, before, after in zip(rows[:20], q[:-1], q[1:], strict=True):
        made._ticks._group.write(row)
        v = made.controller.step(before).v
        assert np.abs(pin.integrate(made.robot.model, before, v * made.dt) - after).max() < 1e-9


@pytest.mark.parametrize("robot", ["romeo_laas_small", "g1"])
def test_links_of_who_is_on_hands_and_toes_stay_above_ground(robot: str) -> None:
    """Feet on their toes as they stand and leave, and hands whose hulls reach below their balls."""
    made = Retargeter(robot)
    for clip, end, noise in ((clips.crawl(), 1.7, 0.0), (clips.crawl(), 1.0, 0.003), (clips.push_ups(), 1.0, 0.003)):
        motion = made.run(motions.part(clips.noisy(clip.clip, 0, noise), 0.0, end))
        for name in ("left_leg", "right_leg"):
            place = motion.plan.chains[:, motion.plan.limbs.index(name), 3]
            heights = motion.plan.turns[name][:, 2] @ motion.body.limbs[name].surface.T + place[:, 2, None]
            assert heights.min() > -1e-9
        assert motion.errors.figures["penetration"] < 1e-3
        assert motion.errors.figures["slide"] < 1e-6
