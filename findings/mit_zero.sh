#!/bin/sh
# damiao-motor 1.0.6: a command of zero torque and zero velocity to a motor in MIT mode is neither.
# Twelve bits divide [-V, V] into 4095 steps, an odd number, so that no code means 0; the encoder rounds down, so that 0 is
# always sent as -V / 4095 and the torque as -T / 4095, also by set_zero_command(). With damping alone, the usual way to
# let an arm down gently, every joint is asked to turn: 4310: -0.0073 rad/s or 25 degrees a minute. What feedback says of
# the motor and is commanded back goes out one step lower for 7 to 8 % of the codes. Codes are read here as the library
# reads feedback. All errors have one sign, so that they add up along an arm; half a step added to commands centres them.
#
# Fails as soon as zero has a code, or what was read is sent back as it was read.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "damiao-motor==1.0.6" "python-can==4.6.1"
timeout 60 "$folder/env/bin/python" - <<'PYTHON'
import can
from damiao_motor import DaMiaoMotor

RANGES = {"4310": (30.0, 10.0), "4340": (10.0, 28.0), "8009": (45.0, 54.0)}
"""Largest velocity [rad/s] and torque [N m] of each motor's codes."""
CODES = 1 << 12
"""Codes of a velocity and of a torque."""

ours = can.Bus(interface="virtual", channel="arm")
theirs = can.Bus(interface="virtual", channel="arm")


def meant(code: int, most: float) -> float:
    return -most + code * 2.0 * most / (CODES - 1)


def sent() -> tuple[int, int]:
    data = theirs.recv(timeout=5.0).data
    return data[2] << 4 | data[3] >> 4, (data[6] & 0xF) << 8 | data[7]


for kind, (fastest, strongest) in RANGES.items():
    motor = DaMiaoMotor(1, 17, ours, motor_type=kind)
    motor.set_zero_command()
    velocity, torque = sent()
    rate, effort = meant(velocity, fastest), meant(torque, strongest)
    lower = 0
    for code in range(CODES):
        feedback = bytes([0x11, 0x80, 0, code >> 4, (code & 0xF) << 4 | code >> 8, code & 0xFF, 25, 25])
        state = motor.decode_sensor_feedback(feedback)
        motor.send_cmd_mit(target_velocity=state["vel"], feedforward_torque=state["torq"])
        again, _ = sent()
        assert again in (code, code - 1)
        lower += again == code - 1
    print(f"{kind}: zero is sent as {rate:+.5f} rad/s and {effort:+.5f} N m; {lower} of {CODES} codes come back one lower")
    assert abs(rate + fastest / (CODES - 1)) < 1e-9 and abs(effort + strongest / (CODES - 1)) < 1e-9
    assert lower > 0.05 * CODES
ours.shutdown()
theirs.shutdown()
PYTHON
