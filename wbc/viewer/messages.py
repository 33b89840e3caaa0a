"""The messages of format 1: targets and rates in, states out, the same over every transport. See docs/viewer.md.

A message is one JSON object with ``type``; ``wbc``: 1 is the format, and may be left out. What a control loop obeys:

    {"type": "set", "item": "hand", "values": {"target": [x, y, z, qx, qy, qz, qw], "weight": 2.0, "enabled": true}}
    {"type": "rate", "item": "hand", "rate": [vx, vy, vz, wx, wy, wz]}       m/s, rad/s, along the world's axes
    {"type": "follow", "item": "hand", "dt": 0.02, "q": [[...], ...]}    a path that takes the item to its target
    {"type": "steer", "rates": [right, ahead, left]}    parts of full speed, of a climb; {"type": "go", "hold": "3,4"}
    {"type": "ask", "on": true}    {"type": "approve"}    every lift of a limb waits for a yes
    {"type": "arm", "name": "arm2"}    {"type": "hand", "rates": [right, ahead, out, left]}    one limb of it
    {"type": "pair", "name": "xi | alpha"}    {"type": "swap"}    {"type": "drive", "rates": [0.5, 0, 0, 0, 0, 0]}
    {"type": "stop"}    {"type": "resume"}    {"type": "operate"}    {"type": "release"}

Poses are position [m] and quaternion x, y, z, w, rotations a quaternion, everything else the numbers of the input. A
rate moves the target until :data:`RATE_LASTS` seconds after the last message, so that a sender that dies stops.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import WbcError
from wbc.validation import Array

FORMAT = 1
#: Types that a loop obeys, with the fields that each must have
OBEYED: dict[str, tuple[str, ...]] = {
    "set": ("item", "values"),
    "rate": ("item", "rate"),
    "follow": ("item", "dt", "q"),
    "stop": (),
    "resume": (),
    "operate": (),
    "release": (),
    "steer": ("rates",),
    "go": ("hold",),
    "ask": ("on",),
    "approve": (),
    "arm": ("name",),
    "hand": ("rates",),
    "pair": ("name",),
    "swap": (),
    "drive": ("rates",),
}
#: Those of them that only a climb obeys
WALKED = ("steer", "go", "ask", "approve", "arm", "hand")
#: Those that only an arm obeys which is driven by pairs of coordinates
PAIRED = ("pair", "swap", "drive")
#: Types between a client and its server alone
SERVED: dict[str, tuple[str, ...]] = {
    "alive": (),
    "seek": ("time",),
    "play": ("speed",),
    "live": (),
    "show": ("what", "on"),
}
#: How long a rate is obeyed [s]
RATE_LASTS = 0.25
#: Longest message [bytes]
LONGEST = 1 << 15


class MessageError(WbcError):
    """A message that is none of this format."""


def read(text: str | bytes) -> dict[str, Any]:
    """A message that came in.

    Raises:
        MessageError: too long, no JSON, no object, of another format or type, or a field is missing.
    """
    if len(text) > LONGEST:
        raise MessageError("message", f"{len(text)} bytes", f"is longer than {LONGEST} bytes")
    try:
        message = json.loads(text)
    except ValueError as error:
        raise MessageError("message", text[:80], f"is no JSON: {error}") from None
    if not isinstance(message, dict):
        raise MessageError("message", text[:80], "is no JSON object")
    if message.get("wbc", FORMAT) != FORMAT:
        raise MessageError("message.wbc", message["wbc"], f"is another format; this is {FORMAT}")
    known = OBEYED | SERVED
    kind = message.get("type")
    if not isinstance(kind, str) or kind not in known:
        raise MessageError("message.type", kind, "is no type of message", sorted(known))
    for field in known[kind]:
        if field not in message:
            raise MessageError(f"message.{field}", None, f"a message of type {kind} needs it")
    if kind == "set":
        validation.mapping("message.values", message["values"], "names to values")
    return message


def write(message: Mapping[str, Any]) -> str:
    """A message to be sent; NaN and infinity, which JSON has not, become null."""
    return json.dumps(_finite(message), separators=(",", ":"), allow_nan=False)


def value_of(kind: str, sent: Any) -> Any:
    """An input's value as a handle takes it, from what was sent for an input of this kind."""
    if kind == "pose" and isinstance(sent, list) and len(sent) == 7:
        return sent[:3], sent[3:]
    return sent


def sent_pose(numbers: Array) -> list[float]:
    """A pose's 12 numbers of a buffer (rotation by columns, position) as it is sent."""
    from wbc.multibody import pin

    pose = pin.SE3(numbers[:9].reshape(3, 3, order="F"), numbers[9:])
    return [float(x) for x in pin.SE3ToXYZQUAT(pose)]


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, np.ndarray):
        return [_finite(v) for v in value.tolist()]
    if isinstance(value, float | np.floating):
        # Six digits are enough for a screen and halve what is sent
        return float(f"{value:.7g}") if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
