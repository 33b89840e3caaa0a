#!/usr/bin/env bash
# ezc3d 1.7.2: a recording of more than 65 535 frames is written whole and read back without its end. 70 000 frames of one
# marker make a file that has room for all of them (16 bytes a frame); the reader takes the header's count, which 16 bits
# hold, gives 65 535 frames, says the same in POINT:FRAMES, and neither raises nor warns. At 240 frames/s that is all
# after the first four and a half minutes. Who needs the rest has to compare with the size of the file.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ezc3d==1.7.2 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/long.c3d" <<'PYTHON'
import pathlib
import sys
import warnings
from importlib.metadata import version

import ezc3d
import numpy as np

warnings.simplefilter("error")
FRAMES, PLACE, COUNT, LIMIT = 70_000, 16, 4, 65_535
made = ezc3d.c3d()
made["parameters"]["POINT"]["RATE"]["value"] = [240.0]
made["parameters"]["POINT"]["LABELS"]["value"] = ["marker"]
points = np.ones((COUNT, 1, FRAMES))
points[0, 0] = np.arange(FRAMES)
made["data"]["points"] = points
made.write(sys.argv[1])
size = pathlib.Path(sys.argv[1]).stat().st_size
again = ezc3d.c3d(sys.argv[1])
read, said = again["data"]["points"], int(np.ravel(again["parameters"]["POINT"]["FRAMES"]["value"])[0])
print("ezc3d", version("ezc3d"), "written:", FRAMES, "frames,", size, "bytes; read:", read.shape[2], "said:", said)
whole = size >= FRAMES * PLACE
raise SystemExit(0 if whole and read.shape[2] == said == LIMIT and read[0, 0, -1] == LIMIT - 1 else 1)
PYTHON
echo "as described"
