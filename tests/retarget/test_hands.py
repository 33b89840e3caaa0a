"""A person's hand leads a robot's, by fingers of the same name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.retarget import clips, motions
from tests.retarget.hand_clips import hand
from wbc import robots
from wbc.retarget import BodyError, Clip, Retargeter, folders, load_clip
from wbc.retarget.correspondence import correspondence
from wbc.retarget.hands import FINGERS
from wbc.retarget.robot_body import RestPose, body_of, hand_plan
from wbc.retarget.sources.layouts import LAYOUTS

#: Points of MANO's order with tips among MediaPipe's
MANO = [0, 5, 6, 7, 9, 10, 11, 17, 18, 19, 13, 14, 15, 1, 2, 3, 4, 8, 12, 16, 20]


def loaded(folder: Path, points: np.ndarray, **options: object) -> Clip:
    np.save(folder / "hand.npy", points)
    return load_clip(folder / "hand.npy", rate=30.0, **options)  # type: ignore[arg-type]  # options are of several types


@pytest.mark.parametrize("robot", ["allegro_right_hand", "allegro_left_hand"])
@pytest.mark.parametrize("left", [False, True])
def test_fingers_bend_as_those_that_lead_them(tmp_path: Path, robot: str, left: bool) -> None:
    points, bends = hand(left=left)
    clip = loaded(tmp_path, points)
    assert "'mediapipe-hand'" in clip.notes[0]
    retargeter = Retargeter(robots.load(robot))
    motion = retargeter.run(clip)
    assert set(motion.stance) == set(FINGERS) - {"little"}
    assert ("mirrored" in " ".join(motion.notes)) == (left == ("right" in robot))
    names = motion.robot.dof_names
    for first in (1, 5, 9):
        sums = motion.q[:, [names.index(f"joint_{k}.0") for k in range(first, first + 3)]].sum(axis=1)
        np.testing.assert_allclose(sums, 3.0 * bends, atol=0.06)
    assert motion.errors.figures["position_breaches"] == motion.errors.figures["velocity_breaches"] == 0
    # Tips of fingers, not of the thumb, whose joints are others
    assert max(motion.errors.points[name].max() for name in ("index", "middle", "ring")) < 0.012
    assert motion.errors.points["thumb"].max() < 0.02


def test_a_frame_at_a_time_is_the_same(tmp_path: Path) -> None:
    clip = loaded(tmp_path, hand()[0])
    retargeter = Retargeter("allegro_right_hand", clip.skeleton)
    motion = retargeter.run(clip)
    live = retargeter.live(clip.rate)
    q = np.array([live.frame(points) for points in clip.points])
    assert np.abs(q[1:] - motion.q[:-1]).max() < 0.1


def test_orders_of_points_and_what_no_finger_leads(tmp_path: Path) -> None:
    points = hand()[0]
    body = body_of(robots.load("allegro_right_hand"))
    assert body.is_hand
    match = correspondence(body, loaded(tmp_path, points).skeleton)
    tips = {name: points[0, one.tip] for name, one in match.limbs.items()}
    for order, layout in ((MANO, "mano-tips"), (MANO[:16], "mano")):
        clip = loaded(tmp_path, points[:, order], names=layout)
        other = correspondence(body, clip.skeleton)
        for name, one in other.limbs.items():
            np.testing.assert_allclose(points[0, order][one.end], points[0, match.limbs[name].end])
            assert layout == "mano" or np.allclose(points[0, order][one.tip], tips[name])
    match.save(tmp_path / "match.yaml")
    assert match.read(tmp_path / "match.yaml").limbs == match.limbs
    # Without a ring and a little finger the robot's ring finger has nobody to follow
    names = LAYOUTS["mediapipe-hand"].names
    few = [k for k, name in enumerate(names) if not name.startswith(("ring", "pinky"))]
    np.savez(tmp_path / "few.npz", points=points[:, few], names=[names[k] for k in few], fps=30)
    skeleton = load_clip(tmp_path / "few.npz").skeleton
    assert "ring has nobody to follow" in " ".join(correspondence(body, skeleton).notes)


@pytest.mark.parametrize(("unit", "length"), [("millimetres", 1e-3), ("centimetres", 1e-2), ("", 1.0)])
@pytest.mark.parametrize("size", [0.6, 1.2])
def test_the_unit_is_that_of_a_hand(tmp_path: Path, unit: str, length: float, size: float) -> None:
    for names in ("mediapipe-hand", "mano", "mano-tips"):
        order = {"mano": MANO[:16], "mano-tips": MANO}.get(names, list(range(21)))
        points = size * hand()[0][:, order]
        clip = loaded(tmp_path, points / length, names=names, up="z")
        np.testing.assert_allclose(np.ptp(clip.points, axis=1), np.ptp(points, axis=1), atol=1e-9)
        assert unit in " ".join(clip.notes)
    # A dog whose names say nothing is no hand
    dog = motions.nameless(clips.dog(0, 20.0).clip.skeleton)
    np.savez(tmp_path / "dog.npz", points=clips.dog(0, 20.0).clip.points / length, parents=dog.parents, names=dog.names)
    found = load_clip(tmp_path / "dog.npz", rate=20.0, up="z")
    assert np.ptp(found.points) == pytest.approx(np.ptp(clips.dog(0, 20.0).clip.points))


def test_what_is_no_hand() -> None:
    body = body_of(robots.load("allegro_right_hand"))
    assert body.is_hand
    for bones in (clips.BONES, clips.DOG_BONES):
        with pytest.raises(BodyError, match="no hand"):
            correspondence(body, clips.skeleton(bones))
    for robot in ("panda", "finger_edu", "alex_nub_hands"):
        assert hand_plan(RestPose(robots.load(robot), {})) is None
    assert "index" not in body_of(robots.load("solo12")).limbs


def test_hands_and_arms_are_loaded_as_they_stand() -> None:
    for robot in ("allegro_left_hand", "alex_nub_hands"):
        assert folders.retargeter_of(robot, (), None).body.robot.base == "fixed"
