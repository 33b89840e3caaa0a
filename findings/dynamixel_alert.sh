#!/bin/sh
# dynamixel-sdk 4.1.0 (Python): a motor's alert is lost where motors are read together, which is how arms are read.
# Every status packet has an error byte, whose bit 7 says that the motor is too hot, overloaded or has the wrong voltage.
# read4ByteTxRx gives that byte; GroupSyncRead takes the same packet, keeps its data and drops the byte: txRxPacket says
# success (0), isAvailable says True, and no method has the error. Two motors of our own on a pseudo-terminal, one with its
# alert on, answer both kinds of read here. Who reads in groups must read address 70 (hardware error status) as well.
#
# Fails as soon as a group's read tells of the alert, or a single read ceases to.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "dynamixel-sdk==4.1.0" "pyserial==3.5"
timeout 60 "$folder/env/bin/python" - <<'PYTHON'
import os
import pty
import threading
import tty

from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, PacketHandler, PortHandler

PRESENT_POSITION, SIZE = 132, 4
"""Address in the control table of X motors, bytes."""
ALERT = 0x80
"""Bit of the error byte: see the hardware error status."""
ERRORS = {1: 0, 2: ALERT}
"""Error byte of each motor."""
SYNC_READ, BROADCAST = 0x82, 0xFE

packets = PacketHandler(2.0)
ours, theirs = pty.openpty()
tty.setraw(ours)
tty.setraw(theirs)


def status(motor: int) -> bytes:
    head = [0xFF, 0xFF, 0xFD, 0x00, motor, SIZE + 4, 0, 0x55, ERRORS[motor]]
    packet = head + list((1000 + motor).to_bytes(SIZE, "little"))
    check = packets.updateCRC(0, packet, len(packet))
    return bytes([*packet, check & 0xFF, check >> 8])


def motors() -> None:
    while asked := os.read(ours, 64):
        everyone = asked[4] == BROADCAST and asked[7] == SYNC_READ
        os.write(ours, b"".join(map(status, ERRORS)) if everyone else status(asked[4]))


threading.Thread(target=motors, daemon=True).start()
port = PortHandler(os.ttyname(theirs))
assert port.openPort()

for motor, error in ERRORS.items():
    value, result, said = packets.read4ByteTxRx(port, motor, PRESENT_POSITION)
    print(f"read alone, motor {motor}: position {value}, result {result}, error byte {said:#04x}")
    assert (value, result, said) == (1000 + motor, COMM_SUCCESS, error)

group = GroupSyncRead(port, packets, PRESENT_POSITION, SIZE)
assert all(group.addParam(motor) for motor in ERRORS)
result = group.txRxPacket()
print(f"read together: result {result}")
for motor in ERRORS:
    there = group.isAvailable(motor, PRESENT_POSITION, SIZE)
    print(f"  motor {motor}: available {there}, position {group.getData(motor, PRESENT_POSITION, SIZE)}")
    assert there
kept = [name for name in vars(group) if "err" in name.lower()] + [name for name in dir(group) if "err" in name.lower()]
print(f"  attributes and methods about errors: {len(kept)}")
assert result == COMM_SUCCESS and not kept
PYTHON
