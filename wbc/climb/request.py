"""What a climb is to be: plain data, as a command line or a file has it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

#: How limbs of a robot's file hold
Holding = Literal["point", "flat", "grip", "rolling-grip", "suction"]


@dataclass(frozen=True)
class ClimbRequest:
    """What climbs, what is climbed, and from where to where.

    Attributes:
        robot: a name of ``wbc.climb.machines``, or a URDF or MJCF file.
        limbs: of a file, frames at the tips of its limbs; their z axes point out of what they hold.
        hold: of a file, how its limbs hold.
        friction: of a file's feet [1].
        scene: a family of ``wbc.climb.scenes``, drawn at the robot's size, or a file of a structure.
        seed: of what is random in the scene.
        density: share of footholds of a family that are there [1].
        gravity: x, y, z [m/s^2]; None: the family's; none of a file.
        start: foothold of a file over which the body is at first.
        goal: foothold over which it is to come; of a family None: the end of the course.
        speed: of the body [m/s]: it goes straight from start to goal at it, without a stop, where footholds are there
            for that; else as the planner finds its way, at most so fast. 0: as fast as joints let it.
        turn_rate: of the body with a speed, at most [rad/s].
        drive: in place of a goal, rates of the body along its axes one after the other, "VX,VY,VZ,WX,WY,WZ for SECONDS"
            [m/s, rad/s]; may be repeated.
        limb: in place of a goal, this limb works while the others hold.
        do: what it does, one after the other: "hold FOOTHOLD", or "rate VX,VY,VZ,WX,WY,WZ for SECONDS" along the
            world's axes [m/s, rad/s]; may be repeated.
        resume: log of a climb of this robot in this scene, from which it goes on to its goal.
        at: time in that log [s]; None: its end.
        vanish: "FOOTHOLD at SECONDS": it is gone from then on; may be repeated.
        fail: "LIMB at SECONDS": it holds no more from then on; may be repeated.
        plant: ``kinematic``, which does as commanded, or ``mujoco``, which takes torques.
        slippery: in MuJoCo, part of the planned friction that there is [1].
        mass_error: in MuJoCo, largest relative error of the links' masses [1].
        delay: in MuJoCo, of the torques, which the loop knows [s].
    """

    robot: str = "hexapod"
    limbs: tuple[str, ...] = ()
    hold: Holding = "point"
    friction: float = 0.6
    scene: str = "stepping_stones"
    seed: int = 0
    density: float = 0.8
    gravity: tuple[float, float, float] | None = None
    start: str | None = None
    goal: str | None = None
    speed: float = 0.0
    turn_rate: float = 0.1
    drive: tuple[str, ...] = ()
    limb: str = ""
    do: tuple[str, ...] = ()
    resume: Path | None = None
    at: float | None = None
    vanish: tuple[str, ...] = ()
    fail: tuple[str, ...] = ()
    plant: Literal["kinematic", "mujoco"] = "kinematic"
    slippery: float = 1.0
    mass_error: float = 0.0
    delay: float = 0.0
