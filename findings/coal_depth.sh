#!/usr/bin/env bash
# Coal 3.0.3: the signed distance of a capsule and a box can be 2.4 m too deep, without an error. Where the end of the
# capsule's axis lies within a few 1e-8 m of a face of the box, the depth should be the capsule's radius (0.0508 m) and
# is -2.40 m, although the two overlap by 0.05 m only and the box is 0.1 m thick there. A shift of either solid by 1e-5 m
# along any axis gives the right depth again. A caller that takes such depths as they are refuses motions that are fine.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check coal==3.0.3 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import coal
import numpy as np

capsule, box = coal.Capsule(0.0508, 0.1524), coal.Box(4.7, 0.24415, 0.1)
turned = np.array(
    [[0.6145672, -0.7888644, -2e-7], [-0.7888644, -0.6145672, -3e-7], [1e-7, 3e-7, -1.0]]
)
request = coal.DistanceRequest()
request.enable_signed_distance = True


def depth(aside):
    at = coal.Transform3s(turned, np.array([-8e-7, 4e-7, 0.1262008]) + aside)
    return coal.distance(capsule, at, box, coal.Transform3s.Identity(), request, coal.DistanceResult())


print("Coal", coal.__version__)
there = depth(np.zeros(3))
beside = [depth(side * 1e-5 * axis) for axis in np.eye(3) for side in (-1.0, 1.0)]
print(f"at the pose {there:.4f} m, 1e-5 m beside it {min(beside):.5f} to {max(beside):.5f} m")
raise SystemExit(0 if there < -2.0 and np.abs(np.array(beside) + 0.0508).max() < 1e-4 else 1)
PYTHON
echo "as described"
