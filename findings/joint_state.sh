#!/usr/bin/env bash
# rosbags 0.11.9: joint positions given as whole numbers become denormal numbers in the bag. serialize_cdr takes the bytes
# of an array as they are: np.array([0, 1, 2]) in JointState.position, which is float64[], is written without a word as
# 0, 4.9e-324 and 9.9e-324, so a robot that was at 2 rad is read to stand at zero. float32 and lists raise (of memoryview
# and of "view"), which makes it look as if types were checked: the element's size is, its kind is not.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
kind = "sensor_msgs/msg/JointState"
stamp = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), "")


def through(position):
    none = np.zeros(0)
    message = store.types[kind](stamp, ["a", "b", "c"], position, none, none)
    return store.deserialize_cdr(store.serialize_cdr(message, kind), kind).position


print("rosbags", version("rosbags"))
exact, whole = through(np.array([0.0, 1.0, 2.0])), through(np.array([0, 1, 2], dtype=np.int64))
print("floats:", exact, "whole numbers:", whole)
raised = []
for other in (np.array([0, 1, 2], dtype=np.float32), [0.0, 1.0, 2.0]):
    try:
        through(other)
    except (ValueError, AttributeError) as error:
        raised.append(f"{type(error).__name__}: {error}")
print("float32 and a list:", raised)
same = exact.tolist() == [0.0, 1.0, 2.0] and whole.tolist() == [0.0, 5e-324, 1e-323] and len(raised) == 2
raise SystemExit(0 if same else 1)
PYTHON
echo "as described"
