"""Drives what `wbc view play` shows from a script of its own: the hand goes round a circle, by rates over a WebSocket.

wbc view play --port 8080 --no-browser
python examples/remote/over_websocket.py ws://127.0.0.1:8080/wbc
"""

import json
import math
import sys
import time

from websockets.sync.client import connect

address = sys.argv[1] if len(sys.argv) > 1 else "ws://127.0.0.1:8080/wbc"
seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 8.0


def send(**message: object) -> None:
    """One message of format 1."""
    socket.send(json.dumps({"wbc": 1, **message}))


with connect(address, max_size=None) as socket:
    hello = json.loads(socket.recv())
    hand = next(item["name"] for item in hello["items"] if item["kind"] == "EndEffector")
    print(f"{hello['robot']}: driving {hand}")
    send(type="operate")
    begin, state = time.monotonic(), {}
    while (t := time.monotonic() - begin) < seconds:
        turn = 2 * math.pi * t / 4.0
        # A rate holds for a quarter of a second: a script that dies stops the robot
        send(type="rate", item=hand, rate=[0.0, -0.1 * math.sin(turn), 0.1 * math.cos(turn), 0.0, 0.0, 0.0])
        message = json.loads(socket.recv())
        if message["type"] == "refused":
            print("refused:", message["reason"])
        state = message if message["type"] == "state" else state
    send(type="rate", item=hand, rate=[0.0] * 6)
    send(type="release")
    print(f"{state['status']}, hand {1e3 * state['items'][hand]['residual']['m']:.1f} mm from its target")
    print(state["sentences"][0])
