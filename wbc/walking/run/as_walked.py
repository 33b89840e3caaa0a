"""The path and the plan of a walk that had none to begin with: what the body and the hands did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.walking.body_path import SPACING, BodyPath
from wbc.walking.log.log import CLOSED, WalkLog
from wbc.walking.planner.plan import Plan, Regrasp
from wbc.walking.run.recording import TickColumns


def as_walked(log: WalkLog, ticks: TickColumns, steps: Sequence[Regrasp]) -> tuple[Plan, TickColumns]:
    """A plan whose path is the way of the logged body, over the time of the log; and ticks that say so.

    Args:
        steps: re-grasps that were begun.
    """
    stride = max(round(SPACING / log.dt), 1)
    poses = [pin.XYZQUATToSE3(row).homogeneous for row in log.pose_body_in_structure[::stride]]
    path = BodyPath(np.array(poses), stride * log.dt)
    closed = [np.flatnonzero(log.hand_state[:, arm] == CLOSED) for arm in range(len(log.arms))]
    start = tuple(log.hold_id[log.hand_hold[rows[0], arm]] if len(rows) else "" for arm, rows in enumerate(closed))
    time = np.minimum(log.t[1:] - log.t[0], path.duration)
    return Plan(path, start, tuple(steps), True, path.duration), replace(ticks, path_time=time)
