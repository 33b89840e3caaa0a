"""Random structures are those of their seeds, the second checker finds what a log is given, and walks violate nothing.

A long run: ``make soak``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.repeats import MORE, repeats
from tests.walking.trials import second_checker, structures
from tests.walking.trials.second_checker import second_check
from tests.walking.trials.structures import FAMILIES, capsule_between, random_structure
from tests.walking.trials.torque_trials import ARMS, Draw
from tests.walking.trials.trials import LIMBS, PARTS, limbs, names, tried
from wbc.clearance import SweptBody
from wbc.errors import UnknownNameError
from wbc.robots import Walker
from wbc.shapes import Sphere
from wbc.walking import Hold, PlaneSurface, Structure, cylinder, read_structure
from wbc.walking.body_path import grid_path
from wbc.walking.log.log import WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.torque.faults import Fault

#: Random structures of a long run, and how many of other trials as :data:`tests.walking.trials.trials.SHARES` says
SEVEN = 7
#: Parts of a short run, of which one trial each is tried: other tests walk in the other modes
SHORT = {"structures": 1, "arm": 5}


@pytest.mark.parametrize("family", FAMILIES)
def test_structures_are_those_of_their_seeds(family: str, tmp_path: Path) -> None:
    digests = set()
    seeds = repeats(1)
    assert random_structure(family, 0).structure.digest == random_structure(family, 0).structure.digest
    for seed in range(seeds):
        trial = random_structure(family, seed)
        structure = trial.structure
        digests.add(structure.digest)
        first, last = (structure[hold].position for hold in (trial.start, trial.goal))
        assert 0.8 < np.linalg.norm(last - first) < 4.0
        # No hold is inside of anything, and the file gives them back
        assert structure.clearance(structure.positions).min() > -1e-9
        read = read_structure(trial.save(tmp_path))
        assert read.ids == structure.ids
        assert read.positions == pytest.approx(structure.positions, abs=1e-12)
        assert [one.id for one in read.obstacles] == [one.id for one in structure.obstacles]
        assert read.clearance(structure.positions) == pytest.approx(structure.clearance(structure.positions), abs=1e-9)
    assert len(digests) == seeds


def test_where_a_wide_body_has_no_place_another_structure_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    first, place = random_structure("bars", 0), structures.has_place
    looked: list[Structure] = []

    def later(structure: Structure, foot: np.ndarray, within: float) -> bool:
        if structure.digest == first.structure.digest:
            looked.append(structure)
            return False
        return place(structure, foot, within)

    monkeypatch.setattr(structures, "has_place", later)
    second = random_structure("bars", 0)
    assert looked
    assert second.structure.digest != first.structure.digest
    assert {second.start, second.goal} <= set(second.structure.ids)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="posts"):
        random_structure("post", 0)


def test_names_of_trials() -> None:
    assert names("structures", 9) == [*(f"{family} 0" for family in FAMILIES), "posts 1", "bars 1"]
    parts = ("structures", "velocity", "arm", "resume", "vanish", "torque")
    assert [len(names(part, 500)) for part in parts] == [500, 200, 100, 200, 100, 100]


@pytest.mark.parametrize("part", ["velocity", "arm", "resume", "vanish"])
def test_every_number_of_limbs_is_tried_in_every_mode(part: str) -> None:
    drawn = [limbs(part, name) for name in names(part, 500)]
    assert drawn == [limbs(part, name) for name in names(part, 500)]
    assert min(drawn.count(kind) for kind in set(drawn)) >= 8
    assert set(drawn) == set(LIMBS) == {2, 3, 4, 5, 6}


def test_draws_of_walks_under_torques_are_those_of_their_seeds(tmp_path: Path) -> None:
    draws = [Draw.of(seed, tmp_path, 0.4) for seed in range(12)]
    assert draws == [Draw.of(seed, tmp_path, 0.4) for seed in range(12)]
    assert len({draw.words for draw in draws}) == 12
    assert {draw.plant for draw in draws} == {"pinocchio", "mujoco"}
    for draw in draws:
        assert np.linalg.norm(draw.gravity) <= ARMS[draw.arms] + 1e-3
        if draw.fault:
            assert Fault.read(draw.fault).kind in draw.fault


@pytest.fixture(scope="module")
def machine() -> Walker:
    return wbc.robots.walker()


@pytest.fixture(scope="module")
def walked(machine: Walker) -> tuple[WalkLog, Structure]:
    """A short walk on the cylinder."""
    structure = cylinder(rigid=True)
    plan = plan_walk(machine, structure, grid_path([(13, 12), (13, 13)], 0.1))
    walk = Walk(machine, structure, plan, stack=WalkStack(machine, structure, collisions=False))
    recorder = WalkRecorder(walk)
    assert walk.run(recorder.tick) == "arrived"
    return recorder.log()[0], structure


def found(log: WalkLog, structure: Structure, machine: Walker, folder: Path) -> list[str]:
    """What the second checker says."""
    log.save(folder / "run.npz")
    return second_check(folder / "run.npz", machine, machine.urdf(folder / "robot.urdf"), structure)


def test_the_second_checker_finds_nothing_in_a_sound_walk(
    walked: tuple[WalkLog, Structure], machine: Walker, tmp_path: Path
) -> None:
    assert found(*walked, machine, tmp_path) == []


def test_the_second_checker_finds_a_thin_post_and_names_it(
    walked: tuple[WalkLog, Structure], machine: Walker, tmp_path: Path
) -> None:
    """It stands where the body's middle passes between two ticks."""
    log, bare = walked
    middle = (log.pose_body_in_structure[100, :3] + log.pose_body_in_structure[101, :3]) / 2
    across = pin.XYZQUATToSE3(log.pose_body_in_structure[100]).rotation[:, 2] * 0.3
    post = capsule_between("thin post", middle - across, middle + across, 1e-4)
    said = found(log, Structure("post", bare.holds, (post,), bare.surface), machine, tmp_path)
    assert any(text.startswith("clearance: -") and "body" in text and text.endswith("thin post") for text in said)


def test_the_second_checker_finds_hands_off_their_holds_and_jumps(
    walked: tuple[WalkLog, Structure], machine: Walker, tmp_path: Path
) -> None:
    log, structure = walked
    poses = log.pose_body_in_structure.copy()
    poses[50:, 0] += 0.003
    said = found(replace(log, pose_body_in_structure=poses), structure, machine, tmp_path)
    assert any("off its hold" in text for text in said)
    assert any(text.startswith("jump of the body's velocity [m/s]: 0.3") for text in said)
    rates = log.v.copy()
    rates[60, 4] += 2.0
    said = found(replace(log, v=rates), structure, machine, tmp_path)
    assert any(text.startswith("acceleration: ") and log.joints[4] in text for text in said)


def test_hands_go_no_deeper_than_they_may(walked: tuple[WalkLog, Structure], machine: Walker, tmp_path: Path) -> None:
    """The same walk over surfaces that are 4 mm and 14 mm higher, with its holds."""
    log, bare = walked
    assert bare.surface is not None
    higher = replace(bare.surface, radius=bare.surface.radius + 0.004)  # type: ignore[call-arg]
    assert found(log, Structure("higher", bare.holds, (), higher), machine, tmp_path) == []
    higher = replace(bare.surface, radius=bare.surface.radius + 0.014)  # type: ignore[call-arg]
    assert found(log, Structure("higher", bare.holds, (), higher), machine, tmp_path) != []


@pytest.mark.parametrize(("gone", "until"), [(0.025, 0.07), (1.0, 0.02)])
def test_the_second_checker_lets_a_hand_stop_near_a_hold_that_vanished(
    gone: float, until: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes nearer after its hold has vanished, and goes away; one whose hold is still there has no such excuse."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    model.addFrame(pin.Frame("hand", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    heights = [0.1, 0.095, 0.09, 0.085, 0.07, 0.06, 0.07, 0.08, 0.09]
    places = [[pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))] for height in heights]
    monkeypatch.setattr(second_checker, "_hands", lambda *_: iter(places))
    log = {
        "hands": np.array(["hand"]),
        "t": 0.01 * np.arange(9),
        "hand_hold": np.array([[0]] * 3 + [[-1]] * 6),
        "hold_pose": np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]),
        "presence_hold": np.array([0]),
        "presence_span": np.array([[0.0, gone]]),
    }
    ground = Structure("ground", (Hold("a", pin.SE3.Identity()),), (), PlaneSurface(pin.SE3.Identity()))
    part = SweptBody("palm", Sphere(0.01), "hand", pin.SE3.Identity())
    (spared,) = second_checker._exemptions(log, model, [part], ground)
    assert (spared.hand, spared.mount) == ("palm", "surface")
    assert (spared.since, spared.until) == (0.0, pytest.approx(until))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("part", PARTS if MORE > 1.0 else SHORT)
def test_trials_violate_nothing_and_crash_nowhere(part: str, tmp_path: Path) -> None:
    """Walks that are carried out keep everything that both checkers look at, however they end."""
    for name in names(part, SHORT[part] if MORE <= 1.0 else repeats(SEVEN)):
        record = tried(part, name, tmp_path / name.replace(" ", "-"))
        assert record["outcome"] not in ("crash", "error"), record
        assert not record.get("violations"), record
        assert not record.get("second"), record


def test_a_trial_that_fails_is_a_record(tmp_path: Path) -> None:
    assert tried("structures", "posts x", tmp_path)["outcome"] == "crash"
