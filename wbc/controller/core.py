"""What a controller is inside: a tick's memory, what gives it its values, and what follows where it has no answer."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import validation
from wbc.controller.handle import POSE, Directions, Handle
from wbc.controller.policy import Fallback, Policy
from wbc.controller.ramps import Ramps
from wbc.controller.sensors import measured_items
from wbc.controller.step import Step
from wbc.controller.together import Plan, Together
from wbc.errors import SolverError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.stack.artifact import Artifact
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Slot
from wbc.tick.buffers import BAD_V
from wbc.tick.context import Context
from wbc.tick.generic import GenericTick
from wbc.tick.native import CompiledTick, NativeTick
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.controller.escape import Escape
    from wbc.controller.watch import Watch
    from wbc.tick.solved import SolvedTick


def assembly_of(stack: Declaration, artifact: Artifact) -> CompiledTick:
    """The native tick, or that of rows on the virtual machine.

    Raises:
        CompileError: as of :class:`GenericTick`. SolverError: the artifact has neither.
    """
    if artifact.library is not None:
        return NativeTick(artifact.library, artifact.layout)
    if artifact.program is not None:
        return GenericTick(artifact.program, stack, artifact.layout, artifact.behind)
    raise SolverError("artifact", artifact, "has neither a library nor a program")


def _nothing() -> None:
    """What is told where nothing is recorded."""


class Core:
    """The memory of one controller and what works on it. Nothing here checks what a user says: :class:`wbc.Controller`
    and :class:`wbc.controller.handle.Handle` do. Packages above have it from :func:`wbc.controller.core_of`.

    Attributes:
        stack, layout: the declaration and its buffers. assembly: rows and QP. tick: the whole cycle on its buffers.
        fallback: what follows a tick without a certified answer. context: what all steps share.
        handles: run-time values of the items by name. row_costs: of each task row at weight 1.
        directions, ramps: of scaled tasks, and of weights that change. together: sets values of several items.
        call: one tick on the buffers as they are, returns its flag; a recorder puts its own in place.
        resets: how many there were. recording: the file that ticks are recorded into, or None. finished: is told that
            ``finish`` has followed a tick with its values in one call; a recorder puts its own in place.
        gate: not 0 where a step is more than a native tick with its values in one call: it ``waits``, ``call`` is not
            ``plain_call``, a thread is within.
        waits: the next step has more to do than to copy q: defaults to take from it, ramps, dt to set back, or native
            code to change over to, which it may not where ``may_change`` is false.
        plain_call: what a native tick with its values in one call does, where it is ``call``; None where there is more.
        measured: items that sensors measure, and ``watch``, which follows their ticks; None without.
    """

    def __init__(
        self, stack: Declaration, artifact: Artifact, solver: str, assembly: CompiledTick | None = None
    ) -> None:
        self.stack, self.layout = stack, artifact.layout
        layout = self.layout
        self.row_costs: Array = 1.0 / layout.row_scales(stack) ** 2
        self.assembly = assembly_of(stack, artifact) if assembly is None else assembly
        self.tick: CompiledTick | SolvedTick = self.assembly
        if solver != "daqp":
            from wbc.tick.solved import SolvedTick

            self.tick = SolvedTick(self.assembly, stack, layout, solver)
        self.fallback = Fallback(self.tick, self.assembly, stack, layout)
        self._tick_call: Callable[[], int] = self.tick.call if isinstance(self.tick, CompiledTick) else self.tick.step
        self._plain_call: Callable[[], int] | None = None
        self.may_change, self.assembly.wake = True, self._wake
        self.context = Context(stack, layout, self.assembly)
        # of all ways to copy some hundred numbers into something immutable, the fastest
        self.snapshot = self.assembly.snapshot
        self.resets, self.ramps, self.gate = 0, Ramps(), np.zeros(3, np.int64)
        self.recording: pathlib.Path | None = None
        self.finished: Callable[[], None] = _nothing
        #: inputs that follow the first configuration, with their items, and those of them that it still has to fill
        self.first: dict[Slot, str] = {}
        self.waiting: dict[Slot, str] = {}
        self.handles = {name: Handle(self, block) for name, block in layout.blocks.items()}
        self.together = Together(self.handles, self.context)
        #: where a pose waits to be taken, and what takes it
        self._poses: dict[Slot, tuple[memoryview, Callable[[], int]]] = {}
        self.directions = Directions(layout, self.tick, self.handles)
        self.measured = measured_items(stack, layout, self.assembly, self.handles)
        self.watch: Watch | None = None
        self._escape: Escape | None = None
        self.follow(self.fallback.policy)
        self.tick.dt[0] = stack.dt
        self.tick.q[:] = stack.robot.neutral
        self.tick.check()
        self.waits = True
        for name, handle in self.handles.items():
            handle.apply()
            for slot in layout.blocks[name].slots.values():
                self._set_default(name, slot)

    def assume(self, other: Core) -> None:
        """Take the values and the last command of another core of the same compiled stack over."""
        for name, handle in self.handles.items():
            handle.assume(other.handles[name])
        for name in ("q", "v_last", "p", "cap", "dt", "weight", "enabled", "bound_enabled"):
            getattr(self.tick, name)[:] = getattr(other.tick, name)
        if self.layout.command != "velocity":
            self.assembly.kept[:] = other.assembly.kept
        self.tick.check()
        self.follow(other.fallback.policy)
        self.ramps.assume(other.ramps, self.handles)
        if other.fallback.prepared:
            self.fallback.prepare()
        self.first, self.waiting, self.waits = dict(other.first), dict(other.waiting), other.waits
        self.permit(other.may_change)

    def follow(self, policy: Policy) -> None:
        """Another policy from now on."""
        self.fallback.policy = policy
        self.call, self._escape = self._tick_call, None
        if policy.escape:
            from wbc.controller.escape import Escape

            self.call = self._escape = Escape(self.call, self.tick, self.fallback, self.context, self.snapshot)
        self._unwatched = self.call
        self.watch = None
        if self.measured:
            from wbc.controller.watch import Watch

            self.call = self.watch = Watch(
                self.call, self._forget, self.tick, self.assembly, self.fallback, self.measured
            )
        self.plain_call = self.call if isinstance(self.tick, CompiledTick) and not policy.escape else None

    @property
    def waits(self) -> bool:
        return bool(self.gate[0])

    @waits.setter
    def waits(self, more: bool) -> None:
        self.gate[0] = more

    @property
    def call(self) -> Callable[[], int]:
        return self._call

    @call.setter
    def call(self, call: Callable[[], int]) -> None:
        self._call = call
        self.gate[1] = call is not self._plain_call

    @property
    def plain_call(self) -> Callable[[], int] | None:
        return self._plain_call

    @plain_call.setter
    def plain_call(self, call: Callable[[], int] | None) -> None:
        self._plain_call = call
        self.gate[1] = self._call is not call

    def again(self) -> Step:
        """A tick on the buffers as they are, sensed inputs included."""
        if (flag := self._unwatched()) and self.finish(flag) < 0:
            self.refuse(self.tick.q.copy(), self.tick.v_in[: self.layout.nv].copy())
        return Step(self.snapshot(), self.context)

    def finish(self, flag: int) -> int:
        """What the policy adds to a tick that ended with ``flag``; negative: refused."""
        return self.fallback.finish(flag)

    def refuse(self, q: Any, v: Any) -> None:
        """Say what was wrong with inputs that the tick refused."""
        self.stack.robot.configuration("q", q)
        validation.real_array("v", v, (self.stack.robot.nv,))
        raise SolverError("step", BAD_V, "the tick refused its inputs")

    def begin(self, configuration: Array | None, velocity: Array) -> None:
        """A reset with checked values."""
        if configuration is not None:
            self.initialise(self.first, configuration)
        self.waiting = {} if configuration is not None else dict(self.first)
        self.tick.v_last[: self.layout.nv] = velocity
        self.assembly.forget()
        self.tick.reset()
        if self._escape is not None:
            self._escape.reset()
        for item in self.measured:
            item.sensor.reset()
        self.resets += 1
        self.waits = True

    def _forget(self) -> None:
        """The next call is the last tick again, from no active set."""
        self.assembly.rewind()
        self.tick.reset()
        self.resets += 1

    def advance(self, dt: float | None) -> None:
        """Another dt than the last, and the ramps' next values."""
        step = self.stack.dt if dt is None else float(dt)
        self.tick.dt[0] = step
        self.ramps.advance(step)
        self.waits = dt is not None or bool(self.ramps)
        # Native code may have been offered meanwhile
        self._wake()

    def _wake(self) -> None:
        """The next step changes over to native code, if some waits and it may."""
        if self.assembly.offered and self.may_change:
            self.waits = True

    def permit(self, change: bool) -> None:
        """Whether ticks may change over to native code."""
        self.may_change = change
        self._wake()

    # Values of items

    def write(self, slot: Slot, numbers: Array) -> None:
        """Write validated numbers of an input; it no longer follows the first configuration."""
        self.tick.p[slot.span] = numbers
        if slot in self.first:
            self._let_go(slot)

    def write_pose(self, slot: Slot, matrix: Array) -> bool:
        """Write a pose from its homogeneous matrix [4, 4]; False, and nothing written, where :meth:`write` has to."""
        place, plan = self._poses.get(slot) or self._add_pose(slot)
        place[:] = matrix.tobytes()
        if not plan():
            return False
        if slot in self.first:
            self._let_go(slot)
        return True

    def _add_pose(self, slot: Slot) -> tuple[memoryview, Callable[[], int]]:
        plan = Plan(self.context, [slot], [POSE])
        self._poses[slot] = plan.places[0], plan.take
        return self._poses[slot]

    def let_go(self, slots: Iterable[Slot]) -> None:
        """Inputs were set, so they no longer follow the first configuration."""
        for slot in slots:
            if slot in self.first:
                self._let_go(slot)

    def _let_go(self, slot: Slot) -> None:
        """An input was set, so it no longer follows the first configuration."""
        del self.first[slot]
        self.waiting.pop(slot, None)

    def start_ramp(self, handle: Handle, weight: float, seconds: float) -> None:
        self.ramps.start(handle, weight, seconds)
        self.waits = True

    def require_value(self, slot: Slot, field: str) -> None:
        """Values that wait for the first configuration cannot be read before it."""
        if slot in self.waiting:
            raise SolverError(field, None, "is taken from the first configuration; call step(q) or reset(q) first")

    def require_values(self) -> None:
        """No value waits for the first configuration."""
        for slot, name in self.waiting.items():
            self.require_value(slot, f"{name}.{slot.input.name}")

    def _set_default(self, name: str, slot: Slot) -> None:
        value = slot.input.default
        if value is None:
            self.waiting[slot] = self.first[slot] = name
            return
        if slot.input.name == "rate":
            value = min(float(value), 1.0 / self.stack.dt_range[1])
        self.tick.p[slot.span] = self.handles[name].checked(slot.input.name, value)

    def take_first(self, q: Array) -> None:
        """What waits for the first configuration is taken from q."""
        self.initialise(self.waiting, q)
        self.waiting = {}

    def initialise(self, slots: Mapping[Slot, str], q: Array) -> None:
        """Values of inputs at a configuration.

        Raises:
            SolverError: an item has no value for one; nothing is written.
        """
        values: list[tuple[Slot, Array]] = []
        initial = {name: self.stack[name].item.initial(self.seen(name), q) for name in set(slots.values())}
        for slot, name in slots.items():
            wanted = slot.input.name
            if wanted not in initial[name]:
                raise SolverError(f"{name}.{wanted}", None, "has no default value; set it before step")
            values.append((slot, self.handles[name].checked(wanted, initial[name][wanted])))
        for slot, numbers in values:
            self.tick.p[slot.span] = numbers

    def frame_pose(self, name: str) -> pin.SE3:
        """Present pose of the moving frame that an item is stated in; the identity for one in the world.

        Raises:
            SolverError: nobody has said where the frame is.
        """
        frame = self.stack[name].frame
        if not frame:
            return pin.SE3.Identity()
        slot = self.layout.blocks[frame].slots["pose"]
        if slot in self.waiting:
            raise SolverError(f"{frame}.pose", None, "has no default value; set it before step")
        return pin.SE3(self.tick.p[slot.span][:9].reshape(3, 3, order="F"), self.tick.p[slot.span][9:])

    def seen(self, name: str) -> Robot:
        """The robot as an item sees it."""
        robot = self.stack.robot
        return robot.seen_from(self.frame_pose(name)) if self.stack[name].frame else robot
