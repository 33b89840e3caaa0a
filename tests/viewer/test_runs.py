"""Recordings as states, as a page that plays offline, and in the reports of runs."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.viewer import arms
from wbc.record.recording import Recording, RecordingError
from wbc.track.page import RunPage, stretches
from wbc.viewer import ViewerError
from wbc.viewer.runs import recording_in, save_page, sentences_of, states_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of 40 ticks."""
    out = tmp_path_factory.mktemp("run")
    controller = arms.fresh()
    q = controller.stack.robot.neutral
    with controller.record(out / "ticks.npz"):
        for _ in range(40):
            step = controller.step(q)
            q = controller.stack.robot.integrate(q, step.v, arms.DT)
            controller["hand"].target = controller["hand"].target.translation + [0.0, 0.01, 0.0], [1.0, 0.0, 0.0, 0.0]
    return out


def test_a_recording_is_a_timeline_of_the_states_that_the_loop_had(folder: Path) -> None:
    file = recording_in(folder)
    assert file is not None
    recording = Recording(file)
    controller, states = states_of(recording, rate=10.0)
    assert [state.number for state in states] == [1, 11, 21, 31]
    assert [state.time for state in states] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert controller.stack.robot.name == "panda"
    said = sentences_of(recording, [3, 39])
    assert set(said) == {3, 39}
    assert said[39].startswith("hand is ")


def test_a_page_plays_offline_and_is_small(folder: Path) -> None:
    controller, states = states_of(Recording(folder / "ticks.npz"), rate=10.0)
    file = save_page(controller, states, folder / "page.html")
    text = file.read_text()
    assert "__VISER_EMBED_DATA__" in text
    assert file.stat().st_size < 3_000_000
    # Nothing is fetched from elsewhere
    assert not re.search(r"""<(?:script|link)[^>]+(?:src|href)=["']https?:""", text)
    with pytest.raises(ViewerError, match="nothing"):
        save_page(controller, [], folder / "none.html")
    with pytest.raises(ViewerError, match="written"):
        save_page(controller, states[:2], folder / "no" / "folder.html")


def test_what_is_no_recording_is_told_from_one(folder: Path, tmp_path: Path) -> None:
    assert recording_in(tmp_path) is None
    np.savez(tmp_path / "ticks.npz", cost=np.zeros(3))
    assert recording_in(tmp_path) is None
    (tmp_path / "ticks.npz").write_bytes(b"nonsense")
    broken = recording_in(tmp_path)
    assert broken is not None
    with pytest.raises(RecordingError):
        Recording(broken)


def test_a_report_stands_alone(tmp_path: Path) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "joints.png")
    page = RunPage("A <run>", "of a & b")
    page.section("Kept")
    page.verdict(True, "this was")
    page.verdict(False, "that was not")
    page.picture(tmp_path / "joints.png")
    page.picture(tmp_path / "absent.png")
    page.histogram(np.array([1.0, 2.0, 2.5, 90.0]), "us")
    page.histogram(np.zeros(0), "us")
    page.strips(np.linspace(0.0, 2.0, 5), {"ball <lower>": np.array([0, 1, 1, 0, 1.0]), "never": np.zeros(5)})
    page.strips(np.linspace(0.0, 2.0, 5), {"never": np.zeros(5)})
    page.links(tmp_path, {"joints.png": "joints", "absent.png": "not there"})
    page.verbatim("a  <b>")
    text = page.save(tmp_path).read_text()
    assert "A &lt;run&gt;" in text
    assert "a  &lt;b&gt;" in text
    assert (text.count('<p class="kept">'), text.count('<p class="missed">')) == (1, 1)
    assert base64.b64encode((tmp_path / "joints.png").read_bytes()).decode() in text
    assert "absent" not in text
    assert "longest 90 us" in text
    assert "ball &lt;lower&gt;: 0.5 s to 1.5 s" in text
    assert "never" not in text
    assert not re.search(r"(?:src|href)=.https?:", text)


def test_stretches() -> None:
    assert stretches(np.array([1, 1, 0, 1, 0, 0, 1])) == [(0, 2), (3, 4), (6, 7)]
    assert stretches(np.zeros(3)) == []
