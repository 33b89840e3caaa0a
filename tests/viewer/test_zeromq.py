"""The messages over ZeroMQ."""

from __future__ import annotations

import json
import time

import pytest
import zmq

from tests.viewer import arms
from wbc.viewer import ViewerError, show
from wbc.viewer.errors import require_local


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
