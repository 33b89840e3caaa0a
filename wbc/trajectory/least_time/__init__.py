"""The fastest law along a path under limits of velocity, acceleration, speed and torque."""
