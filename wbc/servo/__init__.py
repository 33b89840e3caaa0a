"""From ticks to servos: a reference that is kept and followed, see docs/servos.md."""

from wbc.servo.response import Response, identify
from wbc.servo.servo import Following, Servo, ServoStep

__all__ = ["Following", "Response", "Servo", "ServoStep", "identify"]
