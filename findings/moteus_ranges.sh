#!/bin/sh
# moteus 1.1.1 (Python): a target that its number format cannot hold is sent as the largest that it can, and the format of
# one motor is that of all.
# Sixteen bits hold +-3.2767 revolutions, eight bits +-1.27: make_position() with a target of 5 revolutions, behind a gearbox
# a usual one, sends 3.2767 and says nothing. Formats are objects that stand as defaults in the constructor's head, made
# once: the resolution that is lowered on one controller, to fit more motors on a bus, is lowered on every controller that
# was or will be made without one of its own. Give each its own PositionResolution and QueryResolution.
#
# Fails as soon as such a target is refused or sent whole, or controllers have resolutions of their own.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "moteus==1.1.1"
timeout 60 "$folder/env/bin/python" - <<'PYTHON'
import struct

import moteus

REVOLUTIONS = 5.0
"""A target, of the motor."""
LAST = 32767 * 1e-4
"""Largest position in sixteen bits, one revolution being 10 000 of its steps."""
WRITE_FLOATS, WRITE_SHORTS, POSITION = 0x0C, 0x04, 0x20
"""What begins a frame that writes registers, and the register of the position."""


def sent(controller: moteus.Controller) -> float:
    """Position in the frame of a command to go there [revolutions]."""
    data = bytes(controller.make_position(position=REVOLUTIONS).data)
    for first, form, size in ((WRITE_FLOATS, "<f", 1.0), (WRITE_SHORTS, "<h", 1e-4)):
        for count in (0, 1, 2, 3):
            head = bytes([first | count, POSITION])
            if head in data:
                start = data.index(head) + 2
                return size * struct.unpack_from(form, data, start)[0]
            head = bytes([first, count, POSITION])
            if count and head in data:
                start = data.index(head) + 3
                return size * struct.unpack_from(form, data, start)[0]
    raise AssertionError(data.hex())


hip, knee = (moteus.Controller(id=number, transport=object()) for number in (1, 2))
whole = sent(knee)
hip.position_resolution.position = moteus.INT16
ankle = moteus.Controller(id=3, transport=object())
own = moteus.Controller(id=4, transport=object(), position_resolution=moteus.PositionResolution())
cut = [sent(each) for each in (hip, knee, ankle)]
print(f"asked for {REVOLUTIONS} revolutions; knee before: {whole:.4f}")
print("after 16 bits for the hip: hip {:.4f}, knee {:.4f}, a new ankle {:.4f};".format(*cut), f"with its own: {sent(own):.4f}")
assert whole == sent(own) == REVOLUTIONS
assert all(abs(each - LAST) < 1e-9 for each in cut)
PYTHON
