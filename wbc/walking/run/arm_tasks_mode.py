"""Arm mode: what one hand does, task by task, and why each ended.

As of the supervisor of the thesis the first task that is refused or stopped is the last, and then the hand is set down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.simulation import PlantError
from wbc.track.summary import Figure
from wbc.walking.body_path import standing_path
from wbc.walking.log.log import WalkLog
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.arm_mode import ArmMode, ArmStopped
from wbc.walking.modes.drive import standing_plan
from wbc.walking.modes.hand_motion import ArmRefused
from wbc.walking.planner.plan import HoldLost, Plan
from wbc.walking.run.carrying_out import CarryingOut, Outcome, Progress, farthest, travelled
from wbc.walking.run.mode import Ending, Mode, Result, loose_hands
from wbc.walking.run.plausible import ground
from wbc.walking.run.recording import WalkRecorder, as_walked
from wbc.walking.run.request import ArmRequest, ArmTask

Reason = Literal["reached", "time", "key", "refused"]
#: How the run ended, by how its last task did
ENDED: dict[Reason, Outcome] = {"reached": "arrived", "time": "arrived", "key": "interrupted", "refused": "refused"}
#: Time in which a hand that is left in the air is set down [s]
SETTING_DOWN = 30.0


@dataclass(frozen=True)
class ArmStop:
    """How a task ended: ``reached``, ``time`` (of a rate), ``key`` (somebody stopped it) or ``refused``.

    Attributes:
        task: as it was asked. message: why it was refused or stopped. time: of the walk [s].
    """

    task: str
    reason: Reason
    message: str
    time: float


class ArmTasksMode(Mode[ArmRequest]):
    """One hand does the request's tasks while the body stands where the request begins.

    Raises:
        ShapeError: another machine. UnknownNameError: no such arm or hold. What the request's methods raise.
    """

    def __init__(self, request: ArmRequest, walker: Walker) -> None:
        super().__init__(walker)
        data = walker.arm_data
        self.request, self.structure = request, ground(request.site, walker)
        for task in request.tasks:
            if task.kind == "hold":
                self.structure.index(task.hold)
        names = [arm.name for arm in walker.arms]
        self._arm = validation.one_of("arm", request.arm or names[0], names)
        self._pose = request.beginning(data)
        self.path = standing_path(self._pose)

    def plan(self) -> Plan:
        """To stand."""
        return standing_plan(self.walker, self.structure, self._pose)

    def carry_out(
        self, walk: Walk, recorder: WalkRecorder, report: Progress, stop: Callable[[], bool] | None
    ) -> Ending:
        """Task by task, until one is refused or stopped; then the hand comes down."""
        self._mode = mode = ArmMode(walk, self._arm, recorder.tick, stop)
        self._stops = list[ArmStop]()
        for task in self.request.tasks:
            self._stops.append(_done(mode, task))
            if self._stops[-1].message:
                break
        doing = CarryingOut(walk, recorder, progress=report)
        mode.leave()
        walk.set_down()
        late = walk.time + SETTING_DOWN
        while (walk.busy or len(walk.held) < len(self.walker.arms)) and walk.time < late and doing.step():
            pass
        last = self._stops[-1]
        return Ending(doing.outcome or ENDED[last.reason], last.message or doing.reason)

    def figures(self, log: WalkLog | None) -> tuple[Figure, ...]:
        """A line a task, how far the body moved, and how far the hand goes after a stop."""
        out = []
        for k, stop in enumerate(self._stops, start=1):
            text = f"{stop.task}: {stop.reason} at {stop.time:.2f} s{f' ({stop.message})' if stop.message else ''}"
            out.append(Figure(f"task_{k}", f"task {k}", asdict(stop), text))
        if log is not None:
            places = log.pose_body_in_structure[log.t <= self._stops[-1].time, :3]
            moved = float(np.linalg.norm(places - self._pose.translation, axis=1).max())
            out.append(Figure("body_moved", "body moved", moved, f"at most {1e3 * moved:.3f} mm"))
        out.append(farthest(*self._mode.farthest))
        return (*out, *([] if self._mode.stopped is None else [travelled(*self._mode.stopped)]))

    def missed(self, walk: Walk) -> str:
        """The hand is to hold at the end, as the others do."""
        return loose_hands(walk)

    def result(self, walk: Walk, log: WalkLog, ticks: TickColumns) -> Result:
        """The plan is what was done."""
        plan, ticks = as_walked(log, ticks, walk.progress.steps)
        return Result(plan, log, ticks, self.figures(log))


def _done(mode: ArmMode, task: ArmTask) -> ArmStop:
    """One task, and how it ended."""
    reason: Reason = "time" if task.kind == "rate" else "reached"
    message = ""
    try:
        if task.kind == "hold":
            mode.to_hold(task.hold)
        elif task.kind == "poses":
            mode.through([pin.XYZQUATToSE3(np.array(pose)) for pose in task.poses])
        else:
            mode.by_rate(task.twist, task.seconds)
    except ArmStopped as error:
        reason, message = "key", str(error)
    except (ArmRefused, HoldLost, PlantError) as error:
        reason, message = "refused", str(error)
    return ArmStop(task.text, reason, message, mode.walk.time)
