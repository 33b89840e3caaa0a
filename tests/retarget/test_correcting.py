"""A correspondence is corrected by dragging, in memory and from a page."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from websockets.sync.client import connect

from tests.retarget import clips
from tests.retarget.hand_clips import hand
from tests.viewer.clients import heard
from wbc import robots
from wbc.retarget import Correspondence, Retargeter, load_clip
from wbc.retarget.correcting import CorrespondenceEditor
from wbc.viewer import messages, show
from wbc.viewer.paced import ticks


@pytest.fixture
def match() -> Correspondence:
    return Retargeter(robots.load("g1"), clips.skeleton(clips.BONES)).correspondence()


def test_a_target_goes_to_the_nearest_point(tmp_path: Path, match: Correspondence) -> None:
    editor = CorrespondenceEditor(match, tmp_path / "match.yaml")
    names, controller = match.skeleton.names, editor.controller
    assert not editor.look()
    assert match.read(tmp_path / "match.yaml").limbs == match.limbs
    controller["left_arm base"].target = editor.points[names.index("LeftShoulder")] + 0.01
    controller["chest"].target = editor.points[names.index("Spine1")]
    assert editor.look()
    np.testing.assert_array_equal(controller["left_arm base"].target, editor.points[names.index("LeftShoulder")])
    saved = match.read(tmp_path / "match.yaml")
    for now in (editor.match, saved):
        assert names[now.limbs["left_arm"].base] == "LeftShoulder"
        assert now.limbs["left_arm"].chain[1:] == match.limbs["left_arm"].chain[1:]
        assert names[now.chest] == "Spine1"
        assert now.limbs["right_arm"] == match.limbs["right_arm"]
    # Who stops the viewer and resumes puts all targets where the robot is, which is no correction
    controller["left_leg end"].target = editor.points[0]
    assert not editor.look(stopped=True)
    controller["left_leg end"].target = editor.points[0]
    assert not editor.look()
    assert editor.match.limbs == saved.limbs


def test_fingers_and_a_robot_whose_base_is_fixed(tmp_path: Path) -> None:
    np.save(tmp_path / "hand.npy", hand()[0])
    skeleton = load_clip(tmp_path / "hand.npy", rate=30.0).skeleton
    match = Retargeter(robots.load("allegro_right_hand"), skeleton).correspondence()
    editor = CorrespondenceEditor(match, tmp_path / "match.yaml")
    editor.controller["ring tip"].target = editor.points[skeleton.names.index("pinky_tip")]
    assert editor.look()
    assert skeleton.names[match.read(tmp_path / "match.yaml").limbs["ring"].tip] == "pinky_tip"


def test_from_a_page(tmp_path: Path, match: Correspondence) -> None:
    editor = CorrespondenceEditor(match, tmp_path / "match.yaml")
    point = editor.points[match.skeleton.names.index("Spine")]
    with show(editor.controller, open_browser=False) as viewer:

        def run() -> None:
            for _ in ticks(viewer, 0.02, 20.0):
                viewer.update(editor.controller.step(editor.q))
                editor.look(viewer.stopped)

        loop = threading.Thread(target=run)
        loop.start()
        with connect(viewer.url.replace("http", "ws") + "wbc/", max_size=None) as page:
            heard(page, "hello")
            page.send(messages.write({"type": "operate"}))
            page.send(messages.write({"type": "set", "item": "pelvis", "values": {"target": point.tolist()}}))
            until = time.monotonic() + 15.0
            while editor.match.pelvis == match.pelvis and time.monotonic() < until:
                page.send(messages.write({"type": "alive"}))
                time.sleep(0.05)
        viewer.close()
        loop.join()
    assert match.skeleton.names[match.read(tmp_path / "match.yaml").pelvis] == "Spine"
