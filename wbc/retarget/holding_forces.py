"""In how many frames of a motion contacts and motors hold the robot at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import support, tasks, validation
from wbc.api import Stack
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.retarget.retargeted import Retargeted

#: Frames that are looked at by default, evenly spread
FRAMES = 40
#: Least half of a sole's side that counts as a surface [m]
NARROW = 5e-3


@dataclass(frozen=True)
class Support:
    """What holds a robot at the frames of a motion that were looked at.

    Attributes:
        frames: numbers of the frames. contacts: how many limbs stand at each. lacking: the worst row that no contact
            forces and motor torques keep at rest, in words; "" where they hold the robot.
    """

    frames: tuple[int, ...]
    contacts: tuple[int, ...]
    lacking: tuple[str, ...]

    @property
    def share(self) -> float:
        """Share of the frames with contacts in which forces and torques exist; nan is never returned: 0 without any."""
        standing = [not text for text, count in zip(self.lacking, self.contacts, strict=True) if count]
        return float(np.mean(standing)) if standing else 0.0

    def __str__(self) -> str:
        flight = sum(count == 0 for count in self.contacts)
        worst = next((text for text in self.lacking if text), "nothing")
        return (
            f"held at rest in {100.0 * self.share:.0f} % of {len(self.frames) - flight} frames with contacts "
            f"({flight} in the air); lacking first: {worst}"
        )


def held(motion: Retargeted, *, frames: int = FRAMES, friction: float = 0.7) -> Support:
    """Look for contact forces and motor torques that hold the robot at rest, with :func:`wbc.support.lacking`.

    Velocities and accelerations of the motion do not count: a run that is held by its dynamics alone is not held here.

    Args:
        frames: how many frames to look at, evenly spread. friction: Coulomb's coefficient of all contacts.

    Raises:
        RangeError: bad numbers, a robot with a fixed base, or one whose links have no mass.
    """
    frames = validation.integer("frames", frames, low=1)
    friction = validation.scalar("friction", friction, low=1e-3, high=10.0)
    robot, body = motion.robot, motion.body
    if robot.base == "fixed":
        raise RangeError("motion", robot.name, "a fixed base holds the robot")
    contact: dict[str, tasks.SurfaceContact | tasks.PointContact] = {}
    for name, limb in body.limbs.items():
        low, high, frame = limb.corners.min(axis=0), limb.corners.max(axis=0), f"retarget_{name}_contact"
        robot = robot.with_frame(frame, limb.end, pin.SE3(np.eye(3), 0.5 * (low + high)))
        contact[name] = tasks.PointContact(frame, friction=friction)
        long, wide, _ = (0.5 * (high - low)).tolist()
        if limb.contact == "flat" and min(long, wide) > NARROW:
            contact[name] = tasks.SurfaceContact(frame, half_lengths=(long, wide), friction=friction)
    stack = Stack(robot, dt=0.01)
    for name, item in contact.items():
        stack.add(item, name=name)
    stack.add(tasks.TorqueLimits(), name="motors")
    controller = stack.compile(command="torque")
    controller.reset(motion.q[0])
    numbers = np.unique(np.linspace(0, len(motion.q) - 1, min(frames, len(motion.q))).astype(int))
    contacts, words = [], []
    for k in numbers.tolist():
        standing = [name for name in body.limbs if name in motion.stance and motion.stance[name][k]]
        for name in body.limbs:
            controller[name].enabled = name in standing
        lacking = support.lacking(controller, motion.q[k])
        contacts.append(len(standing))
        words.append(str(lacking[0]) if lacking else "")
    return Support(tuple(numbers.tolist()), tuple(contacts), tuple(words))
