"""What a walk is carried out with, compiled and loaded: it belongs to the robot and its structure, not to a walk."""

from __future__ import annotations

import gc

from wbc.robots import Walker
from wbc.walking.holds.structure import Structure
from wbc.walking.log.recorder import versions
from wbc.walking.loop.body_command import pose_function
from wbc.walking.loop.closed_chain import chain_function
from wbc.walking.loop.hand_command import aim_function
from wbc.walking.loop.stack import WalkStack
from wbc.walking.native import compiled


def compiled_stack(
    walker: Walker, structure: Structure, backend: str = "auto", *, collisions: bool = False
) -> WalkStack:
    """A stack; the expressions of the loop and the planner's code are loaded then, too.

    Args:
        collisions, backend: as of :class:`WalkStack`.
    """
    stack = WalkStack(walker, structure, collisions=collisions, backend=backend)
    chain_function(walker)
    pose_function()
    aim_function()
    compiled.library()
    versions()
    return stack


def keep() -> None:
    """Say that all that is there now is there to stay: the garbage collector leaves it alone.

    For a program of its own (a command, a benchmark), once what it needs is loaded. A full collection looks at every
    object, which with the modules of a walk takes some 80 ms in the middle of a plan or a tick, and finds nothing.
    """
    gc.collect()
    gc.freeze()
