"""``wbc view`` as a user types them, as far as they go without a browser."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest
from typer.testing import CliRunner
from websockets.sync.client import connect

from tests.viewer import arms
from wbc.cli.app import app
from wbc.robots import load
from wbc.viewer.presets import PRESETS, of_robot, playground


def run(*arguments: str) -> tuple[int, str, str]:
    """(exit code, standard output, standard error)."""
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, arguments)
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("name", [n for n in PRESETS if n not in ("talos", "g1")])
def test_every_preset_is_declared_and_begins_where_it_keeps_clear(name: str) -> None:
    stack, start, about = playground(name)
    assert stack.robot.configuration("start", start) is not None
    assert about.endswith(".")
    assert any(type(entry.item).__name__ == "EndEffector" for entry in stack.tasks)


@pytest.mark.parametrize("name", ["panda", "double_pendulum", "ssrms"])
def test_any_robot_has_sliders(name: str) -> None:
    chosen = of_robot(load(name))
    controller = chosen.stack.compile(backend="vm")
    controller.reset(chosen.start)
    assert controller.step(chosen.start).status == "solved"


def test_a_folder_with_a_page_alone_is_its_page(tmp_path: Path) -> None:
    (tmp_path / "replay.html").write_text("page")
    code, out, _ = run("view", str(tmp_path), "--no-browser")
    assert (code, out.strip()) == (0, (tmp_path / "replay.html").as_uri())


def test_a_recording_is_played_and_sought(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    controller = arms.fresh()
    q = controller.stack.robot.neutral
    with controller.record(tmp_path / "ticks.npz"):
        for _ in range(30):
            q = controller.stack.robot.integrate(q, controller.step(q).v, arms.DT)
    seen: list[float] = []

    def look(url: str) -> None:
        with connect(url.replace("http", "ws") + "wbc", max_size=None) as socket:
            assert json.loads(socket.recv())["live"] is False
            for text in ('{"type": "operate"}', '{"type": "play", "speed": 0.0}', '{"type": "seek", "time": 0.2}'):
                socket.send(text)
            while not (seen and 0.16 < seen[-1] <= 0.2):
                message = json.loads(socket.recv(timeout=10.0))
                if message["type"] == "state":
                    seen.append(message["t"])
            socket.send('{"type": "set", "item": "hand", "values": {"weight": 2.0}}')
            while message["type"] != "refused":
                message = json.loads(socket.recv(timeout=10.0))
            assert "recording" in message["reason"]

    looker: list[threading.Thread] = []

    def say(url: str) -> None:
        looker.append(threading.Thread(target=look, args=(url,)))
        looker[0].start()

    monkeypatch.setattr("wbc.cli.view.show", say)
    code, _, err = run("view", str(tmp_path), "--no-browser", "--seconds", "6")
    assert code == 0, err
    looker[0].join()
    # The state that is kept before that time
    assert 0.16 < seen[-1] <= 0.2
