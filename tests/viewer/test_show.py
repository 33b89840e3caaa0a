"""The viewer beside a loop of the user's own: a process, shared memory, messages over ZeroMQ, and its end."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable

import numpy as np
import pytest
import zmq
from websockets.sync.client import connect

from tests.repeats import ALL, MORE
from tests.viewer import arms
from wbc.viewer import ViewerError, show
from wbc.viewer.errors import require_local


def test_a_loop_is_driven_and_its_viewer_lost() -> None:
    controller = arms.fresh()
    robot, q = controller.stack.robot, controller.stack.robot.neutral
    with show(controller, open_browser=False, silence=20.0) as viewer:
        with connect(viewer.url.replace("http", "ws") + "wbc", max_size=None) as socket:
            hello = json.loads(socket.recv(timeout=20.0))
            assert hello["type"] == "hello"
            socket.send('{"type": "operate"}')
            socket.send('{"type": "set", "item": "posture", "values": {"weight": 0.5}}')
            until = time.monotonic() + 20.0
            while not (viewer.operated and controller["posture"].weight == 0.5):
                assert time.monotonic() < until
                step = controller.step(q)
                viewer.update(step)
                socket.send('{"type": "alive"}')
                q = robot.integrate(q, step.v, arms.DT)
            assert not viewer.stopped
        # The operator's connection is gone
        while not viewer.stopped:
            assert time.monotonic() < until + 10.0
            viewer.update(controller.step(q))
            time.sleep(0.01)
        assert viewer.running
    assert not viewer.running
    viewer.close()
    viewer.update(controller.step(q))
    assert np.abs(controller.step(q).v).max() < 1e-6


@pytest.mark.parametrize("end", [subprocess.Popen.kill, subprocess.Popen.terminate][: 2 if MORE >= ALL else 1])
def test_a_viewer_that_dies_while_somebody_operates_stops_the_robot(
    end: Callable[[subprocess.Popen[bytes]], None],
) -> None:
    controller = arms.fresh()
    q = controller.stack.robot.neutral
    with show(controller, open_browser=False, silence=0.3) as viewer:
        viewer.operation.obey({"type": "operate"})
        end(viewer._process)
        until = time.monotonic() + 10.0
        while not viewer.stopped:
            assert time.monotonic() < until
            viewer.update(controller.step(q))
            time.sleep(0.01)
        while viewer.running:
            assert time.monotonic() < until


def test_bad_arguments_start_nothing() -> None:
    controller = arms.fresh()
    with pytest.raises(ViewerError, match="viewer"):
        show(controller, host="192.0.2.1", open_browser=False)


@pytest.mark.parametrize("address", ["tcp://0.0.0.0:5555", "tcp://*:5555", "tcp://192.168.0.1:1", "inproc://a", "5555"])
def test_addresses_of_other_machines_are_refused(address: str) -> None:
    with pytest.raises(ViewerError, match="this machine"):
        require_local(address)


def test_a_peer_operates_and_is_lost_when_it_is_silent(tmp_path: object) -> None:
    controller = arms.fresh()
    q, address = controller.stack.robot.neutral, f"ipc://{tmp_path}/socket"
    with (
        show(controller, open_browser=False, zeromq=address, silence=0.5) as viewer,
        zmq.Context() as context,
        context.socket(zmq.DEALER) as peer,
    ):
        peer.linger = 0
        peer.connect(address)
        for message in ({"type": "operate"}, {"type": "set", "item": "posture", "values": {"weight": 0.25}}):
            peer.send_string(json.dumps(message))
        until = time.monotonic() + 20.0
        while controller["posture"].weight != 0.25:
            assert time.monotonic() < until
            viewer.update(controller.step(q))
            time.sleep(0.01)
        assert json.loads(peer.recv())["type"] == "hello"
        while not viewer.stopped:
            assert time.monotonic() < until
            viewer.update(controller.step(q))
            time.sleep(0.01)
