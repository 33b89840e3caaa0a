"""Many robots, or many candidate states, of one compiled stack: arrays in, arrays out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from wbc import validation
from wbc.batch import numbers
from wbc.batch.batch_step import BatchStep
from wbc.batch.derivatives import Derivatives
from wbc.batch.engine import BatchEngine, Clones, Compiled, Given
from wbc.batch.pullback import Pullback, reason_against
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.handle import CONFIGURATION, NUMBERS, POSE, Handle
from wbc.controller.together import main_input
from wbc.cores import cores
from wbc.errors import RangeError, ShapeError, SolverError, UnknownAttributeError
from wbc.sealed import Sealed
from wbc.stack.codegen import unit_groups
from wbc.stack.layout import Slot
from wbc.stack.program import left_to_loops
from wbc.tasks.inputs import require_order
from wbc.tick.buffers import INFINITE
from wbc.tick.native import NativeTick
from wbc.validation import Array

#: Most robots, and most threads, of a batch
MOST = 2**31 - 1


class Batch(Sealed):
    """n robots with the same stack, each with its own run-time values, last command and active set.

        batch = controller.batch(10_000)
        batch.set(hand=poses)                        # [n, 4, 4], or one pose for all
        step = batch.step(q)                         # q [n, nq] -> step.v [n, nv], step.status_codes [n]

    Every tick equals that of a controller that was given the same values, bit for bit, whatever the number of threads
    is. Made by :meth:`wbc.Controller.batch`; values, weights, switches and policy begin as that controller's.

    Attributes:
        count: n. threads: that tick at a time. inputs: what robots' ticks read [n, k]; not for users.
        changes: how often anything was changed.
    """

    _changing = ("changes",)

    def __init__(self, controller: CompiledStack, count: int, threads: int | None = None) -> None:
        core = core_of(controller)
        _require_count("count", count)
        if threads is not None:
            _require_count("threads", threads)
        if core.measured:
            names = ", ".join(repr(item.handle.item_name) for item in core.measured)
            raise SolverError("batch", names, "measures distances with a library, which a batch does not")
        if controller.policy.escape:
            raise SolverError("batch", controller.policy, "a batch has no escape; set a policy without it")
        self.count, self.changes = count, 0
        self.threads = min(count, threads or cores())
        #: a controller for the checks of values
        self._core = core_of(controller.clone())
        self._memory, self._layout = self._core.context.memory, self._core.layout
        self._engine: BatchEngine
        if isinstance(core.tick, NativeTick):
            self._engine = Compiled(controller, count, self.threads)
        else:
            self._engine, self.threads = Clones(controller, count), 1
        self.inputs: Array = np.tile(self._core.tick.state[self._memory.report :], (count, 1))
        self._units = unit_groups(core.stack)
        #: inputs that each robot's first configuration still has to fill, with their items
        self._waiting: dict[Slot, str] = dict(core.waiting)
        self._first: dict[Slot, str] = dict(core.waiting)

    def _view(self, name: str) -> Array:
        where, start = self._memory[name], self._memory.report
        return self.inputs[:, where.start - start : where.stop - start]

    def set(self, **values: Any) -> None:
        """Set run-time values by the item's name; all are checked before any is written.

            batch.set(hand=poses, posture=q)                            # the target
            batch.set(hand={"target": poses, "weight": weights})        # several values of one item

        Args:
            values: one value for all robots, or an array with an axis of n before those of a single value. Arrays of
                other libraries are taken through DLPack.

        Raises:
            UnknownNameError: no such item, or no such value. WbcError: as of a single value; nothing is changed.
        """
        asked: list[tuple[Handle, Mapping[str, Any]]] = []
        for name, given in values.items():
            handle = self._core.handles[validation.one_of("set", name, self._core.handles)]
            asked.append((handle, given if isinstance(given, Mapping) else {main_input(handle): given}))
        if (quick := self._quick(asked)) and self._engine.take(self.inputs, list(quick.values())):
            self._filled(quick)
            return
        found: list[tuple[Array, Array]] = []
        filled: list[Slot] = []
        for handle, own in asked:
            slots = {key: numbers_ for key, numbers_ in own.items() if key != "weight"}
            checked = {key: self._checked(handle, key, value) for key, value in slots.items()}
            self._check_order(handle, checked)
            for key, flat in checked.items():
                slot = handle.slot(key)
                found.append((self._view("p")[:, slot.span], flat))
                filled.append(slot)
            if "weight" in own:
                found.append(self._weights(handle, own["weight"]))
        for place, flat in found:
            place[:] = flat
        self._filled(filled)

    def _filled(self, slots: Iterable[Slot]) -> None:
        """These have values now."""
        for slot in slots:
            self._waiting.pop(slot, None)
            self._first.pop(slot, None)
        self.changes += 1

    def _quick(self, asked: list[tuple[Handle, Mapping[str, Any]]]) -> dict[Slot, Given]:
        """Values as native code takes them; none where it does not take all of them."""
        found: dict[Slot, Given] = {}
        for handle, own in asked:
            kinds = handle.quick
            for key, value in own.items():
                if key not in kinds or key not in handle.names:
                    return {}
                slot, kind = handle.slot(key), kinds[key]
                shape = (4, 4) if kind == POSE else (slot.size,)
                if (one := self._given(value, shape, kind, self._memory["p"].start + slot.start)) is None:
                    return {}
                found[slot] = one
        return found

    def _given(self, value: Any, shape: tuple[int, ...], kind: int, at: int) -> Given | None:
        """A value for the engine, with its place in memory; None where it is no array of one or of all."""
        array, shapes = numbers.taken(value), (shape, (self.count, *shape))
        if type(array) is not np.ndarray or array.dtype != np.float64 or array.shape not in shapes:
            return None
        return Given(np.ascontiguousarray(array), kind, at - self._memory.report, math.prod(shape))

    def _checked(self, handle: Handle, key: str, value: Any) -> Array:
        slot = handle.slot(key)
        field = f"{handle.item_name}.{key}"
        if slot.input.sensed:
            raise RangeError(field, value, "is measured in every tick and cannot be set")
        robot = self._core.stack.robot
        return numbers.flat(robot, field, slot.input, value, self.count, lambda one: handle.checked(key, one))

    def _check_order(self, handle: Handle, checked: Mapping[str, Array]) -> None:
        """Bounds that come in pairs are in order, for each robot."""
        for key in checked:
            slot = handle.slot(key)
            if (upper := slot.input.below) is None:
                pairs = [(low, key) for low in handle.names if _below(handle, low) == key]
            else:
                pairs = [(key, upper)]
            for low, high in pairs:
                sides = [checked.get(name, self._view("p")[:, handle.slot(name).span]) for name in (low, high)]
                for k in np.flatnonzero((sides[0] > sides[1]).any(axis=1)).tolist():
                    field = f"{handle.item_name}.{key}[{k}]"
                    require_order(field, sides[0][k], sides[1][k], f"{low} is above {high}")

    def _weights(self, handle: Handle, value: Any) -> tuple[Array, Array]:
        """Where an item's weights are, and the numbers for them."""
        field = f"{handle.item_name}.weight"
        if "weight" not in handle.names:
            raise UnknownAttributeError(field, "weight", handle.names)
        given = validation.real_array(field, numbers.taken(value))
        if given.shape not in ((), (self.count,)):
            raise ShapeError(field, value, f"expected one number or {self.count}, is of shape {given.shape}")
        for k in np.flatnonzero(np.atleast_1d(given) < 0.0).tolist():
            validation.scalar(f"{field}[{k}]", np.atleast_1d(given)[k], low=0.0)
        unit = handle.unit_weights()
        span = self._layout.blocks[handle.item_name].span
        return self._view("weight")[:, span], np.broadcast_to(given, (self.count,))[:, None] * unit

    def step(self, q: Any, v: Any = None, dt: Any = None) -> BatchStep:
        """One tick of every robot, see :meth:`wbc.Controller.step`.

        Args:
            q: configurations [n, nq], or one for all. v: measured velocities [n, nv]; default: the last commands.
            dt: time until the next command [s]; default: the declared one.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: bad input; nothing is changed, and the field says
                which robot's.
        """
        stack = self._core.stack
        low, high = stack.dt_range
        seconds = stack.dt if dt is None else validation.scalar("dt", dt, low=low, high=high, unit="s")
        reports, quick = np.empty((self.count, self._memory.report)), self._quick_state(q, v, seconds)
        if quick and self._waiting and self._engine.fit(quick):
            self._take_first(np.broadcast_to(quick[0].numbers, (self.count, stack.robot.nq)))
        if not quick or self._waiting or not self._engine.tick(self.inputs, reports, quick):
            self._set_state(q, v, seconds)
            self._engine.tick(self.inputs, reports, [])
        self.changes += 1
        return BatchStep(reports, self, self._core.context)

    def _quick_state(self, q: Any, v: Any, seconds: float) -> list[Given]:
        """What a step is given as native code takes it; nothing where it does not."""
        layout, place = self._layout, self._memory
        found = [
            self._given(q, (layout.nq,), CONFIGURATION, place["q"].start),
            self._given(np.array([seconds]), (1,), NUMBERS, place["dt"].start),
        ]
        if v is not None:
            found.append(self._given(v, (layout.nv,), NUMBERS, place["v_in"].start))
            found.append(self._given(np.ones(1), (1,), NUMBERS, place["use_v"].start))
        known = [given for given in found if given is not None]
        return known if len(known) == len(found) else []

    def _set_state(self, q: Any, v: Any, seconds: float) -> None:
        """The same, checked in Python."""
        configurations = numbers.configurations(self._core.stack.robot, q, self.count, self._units)
        measured = None if v is None else numbers.rows("v", v, self.count, self._layout.nv)
        self._take_first(configurations)
        self._view("q")[:] = configurations
        self._view("dt")[:] = seconds
        if measured is not None:
            self._view("v_in")[:, : self._layout.nv] = measured
            self._view("use_v")[:] = 1.0

    def reset(self, q: Any = None, v: Any = None) -> None:
        """Start anew, see :meth:`wbc.Controller.reset`; q [n, nq] and v [n, nv], or one for all.

        Raises:
            ShapeError, NotFiniteError, RotationError: bad input; nothing is changed.
        """
        robot = self._core.stack.robot
        configurations = None if q is None else numbers.configurations(robot, q, self.count, self._units)
        velocity = np.zeros(robot.nv) if v is None else numbers.rows("v", v, self.count, robot.nv)
        self._waiting = dict(self._first)
        if configurations is not None:
            self._take_first(configurations)
        self._view("v_last")[:, : robot.nv] = velocity
        if self._layout.command != "velocity":
            # No wrenches are kept, and the last torques are not known
            self._view("kept")[:] = 0.0
            self._view("kept")[:, : robot.nv] = INFINITE
        self._engine.forget()
        self.changes += 1

    def _take_first(self, q: Array) -> None:
        """What waits for the first configuration is taken from each robot's."""
        if not self._waiting:
            return
        core, spans = self._core, [slot.span for slot in self._waiting]
        alike = self.count == 1 or bool((q == q[0]).all())
        found = np.empty((self.count, core.layout.parameters))
        for k in range(1 if alike else self.count):
            core.tick.p[:] = self._view("p")[k]
            core.initialise(self._waiting, q[k])
            found[k] = core.tick.p
        found[1:] = found[0] if alike else found[1:]
        for span in spans:
            self._view("p")[:, span] = found[:, span]
        self._waiting = {}

    @cached_property
    def derivatives(self) -> Derivatives | None:
        """What differentiates all ticks at once; None where each is done alone."""
        layout, tick = self._layout, self._core.tick
        soft = any(at >= 0 for at in layout.price_at)
        return (
            Derivatives(tick, self._core.context)
            if isinstance(tick, NativeTick) and not (soft or layout.cascade)
            else None
        )

    @property
    def held_back(self) -> bool:
        """Whether bounds on velocities or margins hold a robot back, which is differentiated for each alone."""
        return bool(self._view("shortfall").any() or self._view("pressed").any())

    @cached_property
    def pullback(self) -> Pullback:
        """What differentiates backwards.

        Raises:
            SolverError: the stack's ticks are not all in its CasADi functions. CompileError: no compiler.
        """
        why = reason_against(self._core.context)
        if not why and (self.derivatives is None or any(left_to_loops(self._core.stack, self._layout))):
            why = "it is not compiled, or measures distances in a loop"
        if why:
            raise SolverError("pull", self._core.stack.robot.name, f"the stack has no backward pass: {why}")
        assert self.derivatives is not None
        return Pullback(self.derivatives, self._core.context, self.threads)

    def __len__(self) -> int:
        return self.count

    def __repr__(self) -> str:
        stack = self._core.stack
        return f"<Batch of {self.count} {stack.robot.name}: {', '.join(e.name for e in stack.entries)}>"


def _below(handle: Handle, name: str) -> str | None:
    """The input that an input may not exceed."""
    return None if name in ("weight", "enabled", "mask") else handle.slot(name).input.below


def _require_count(field: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST:
        raise RangeError(field, value, f"expected an integer from 1 to {MOST}")
