"""Named configurations of an SRDF file."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc.errors import RobotFileError
from wbc.robot.files import read_xml
from wbc.validation import Array


def read_states(path: pathlib.Path) -> dict[str, dict[str, Array]]:
    """State name -> joint name -> its numbers in q, in the file's spelling.

    A joint may have several numbers (a free flyer: position, quaternion x, y, z, w).

    Raises:
        RobotFileError: the file cannot be read, or a value is not a number.
    """
    _, tree = read_xml(path)
    states: dict[str, dict[str, Array]] = {}
    for state in tree.findall("group_state"):
        values = states.setdefault(str(state.get("name")), {})
        for joint in state.findall("joint"):
            text = joint.get("value", "")
            try:
                values[str(joint.get("name"))] = np.array([float(x) for x in text.split()])
            except ValueError as error:
                raise RobotFileError("srdf", str(path), f"value of joint {joint.get('name')}: {text!r}") from error
    return states
