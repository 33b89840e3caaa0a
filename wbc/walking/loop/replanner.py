"""What a walk does next when its plan does not lead on."""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.walking.body_path import BodyPath, standing_path, straight_path
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.planner.replanning import PlanSlices, plan_from_here, plan_from_stance, plan_rest

#: Speed towards another path [m/s]
JOINING = 0.05


class BodyReplanner:
    """Plans, in slices, from where a body stands: the rest of its path, or the straight line to another and then that.

    Attributes:
        sight: what proves that a free hand may go to where a plan begins; None: nothing does.
    """

    def __init__(self, machine: Machine, progress: PlanProgress) -> None:
        self._machine, self._progress = machine, progress
        self._wanted: BodyPath | None = None
        self.sight: Foresight | None = None
        self._quick = True

    def go(self, goal: BodyPath) -> None:
        """Follow another path from now on.

        Raises:
            ShapeError: it is none; nothing is changed.
        """
        self._wanted, self._quick = validation.instance("path", goal, BodyPath, "a BodyPath"), True

    def stand(self) -> None:
        """Plan to stay where the body is on its path, all hands on holds that it can keep."""
        self._wanted, self._quick = standing_path(self._progress.pose), False

    def from_stance(self, wanted: bool) -> None:
        """Whether hands that all hold may be taken as the first stance, which is the quickest plan."""
        self._quick = wanted

    def rest(self) -> PlanSlices:
        """Plan the rest from where the body stands; a free hand goes to where the plan has it.

        Raises:
            NoPlanError: there is no plan.
        """
        machine, progress = self._machine, self._progress
        walker, path, pose = machine.walker, progress.plan.path, progress.pose
        if self._wanted is None:
            rest = path.poses[int(progress.sample) + 1 :]
        else:
            between = straight_path([pose, self._wanted.poses[0]], JOINING).poses
            rest = np.concatenate([between, self._wanted.poses])
        whole = BodyPath(np.concatenate([pose.homogeneous[None], rest]), path.spacing)
        if self._quick and len(machine.held) == len(walker.arms):
            start = {progress.names[arm]: machine.structure.ids[hold] for arm, hold in machine.held.items()}
            postures = {arm.name: machine.q[arm.q] for arm in walker.arms}
            return plan_from_stance(walker, machine.structure, whole, start, postures=postures)
        behind = progress.behind()
        may = None if self.sight is None else self.sight.may_bring
        return plan_from_here(walker, machine.structure, whole, machine.held, machine.q, machine.chain, behind, may)

    def without(self, kept: int) -> PlanSlices:
        """Plan anew all but some re-grasps along the same path while the body goes on."""
        machine, progress = self._machine, self._progress
        return plan_rest(machine.walker, machine.structure, progress.plan, kept, progress.path_time)

    def taken(self) -> None:
        """What was planned last is carried out now: it is the path of the plan."""
        self._wanted = None
