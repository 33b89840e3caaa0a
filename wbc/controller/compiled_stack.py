"""A compiled stack that ticks: checks what the user says, makes one call, wraps the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from wbc import validation
from wbc.controller.core import Core
from wbc.controller.handle import Handle
from wbc.controller.handles import Handles
from wbc.controller.policy import Policy
from wbc.controller.step import Step
from wbc.errors import BusyError, PicklingError, RangeError, ShapeError, SolverError
from wbc.multibody import is_pose
from wbc.qp.problem import QP
from wbc.stack.artifact import Artifact
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout
from wbc.tick.native import REFUSED, CompiledTick
from wbc.validation import Array

_Array = np.ndarray
_FLOAT = np.dtype(np.float64)
#: Of the numbers of a gate: a thread is within
BUSY = 2
#: Of the table of a stepper: the tick with values
WITH_VALUES = 2


class CompiledStack(Handles):
    """The ticks of a compiled stack with its run-time values; :class:`wbc.Controller` adds what is made of one.

    Each has its own memory, see :meth:`clone`; one of them must not be stepped from two threads at once.

    Attributes:
        stack: the declaration that it was compiled from.
        solver: name of the QP solver.
        cached: the compiled stack was found in the cache.
    """

    def __init__(
        self, stack: Declaration, artifact: Artifact, solver: str, assembly: CompiledTick | None = None
    ) -> None:
        self.stack, self.solver, self.cached = stack, solver, artifact.cached
        self._artifact = artifact
        self._core = core = Core(stack, artifact, solver, assembly)
        super().__init__(core.handles, stack)
        # What every step needs
        # A memoryview takes bytes in half the time in which an array takes an array
        self._q = core.tick.q.data.cast("B")
        self._v_in, self._use_v = core.tick.v_in[: core.layout.nv], core.tick.use_v
        self._q_shape, self._v_shape = (core.layout.nq,), (core.layout.nv,)
        self._snapshot, self._context, self._sensed = core.snapshot, core.context, bool(core.measured)
        self._plans, self._gate = core.together.plans, core.gate
        nothing = core.together.none.request
        step, self._cycles = core.assembly.stepper(self._gate, nothing, self.step, self._finished)
        if type(self).step is CompiledStack.step:
            # The same, where that is one call of C, with the targets of the last step that had any
            self.__dict__["step"] = step

    def step(self, q: Any, v: Any = None, dt: Any = None, **targets: Any) -> Step:
        """One control cycle: the command v for the next dt seconds.

            command = controller.step(q, hand=pose, posture=q).v      # targets in, command out: one call of C

            minimise   sum over task rows of w (J v + gain e + de/dt)^2 + damping |v|^2
            subject to the constraints' rows and bounds

        Args:
            q: configuration [nq]; any real array or sequence.
            v: measured velocity [nv] that acceleration bounds are counted from; default: the last command
                (zero after a reset).
            dt: time until the next command [s], within ``stack.dt_range``; default: the declared one.
            targets: what :meth:`set` sets before; arrays of doubles, poses as 4x4 matrices, cost the least.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: bad input; the controller is unchanged.
            UnknownNameError: as of :meth:`set`. BusyError: another thread is within ``step`` of this controller.
        """
        if self._gate[BUSY]:
            raise BusyError("step", self.stack.robot.name, "this controller is in use by another thread; clone() it")
        core = self._core
        if v is None and dt is None and not core.waits and core.call is core.plain_call:
            # In one call, with the interpreter's lock, so that no other thread is within
            done = self._cycle_as_planned(q, targets)
            if isinstance(done, Step):
                return done
            if done >= 0:
                return self._finished(done, q)
        if targets:
            self._set_first(q, v, dt, targets)
        try:
            self._gate[BUSY] = 1
            if waits := dt is not None or core.waits:
                self._prepare(q, v, dt)
            if not (type(q) is _Array and q.dtype is _FLOAT and q.shape == self._q_shape):
                q = validation.real_array("q", q, self._q_shape)
            if v is not None and not (type(v) is _Array and v.dtype is _FLOAT and v.shape == self._v_shape):
                v = validation.real_array("v", v, self._v_shape)
            # What may raise is over
            if v is not None:
                self._v_in[:] = v
                self._use_v[0] = 1.0
            self._q[:] = q.tobytes()
            if self._sensed:
                core.assembly.sense()
            if waits:
                core.advance(dt)
            if (flag := core.call()) and core.finish(flag) < 0:
                core.refuse(q, v)
            return Step(self._snapshot(), self._context)
        finally:
            self._gate[BUSY] = 0

    def _cycle_as_planned(self, q: Any, targets: dict[str, Any]) -> Step | int:
        """The same of other targets than those of the last step, or of poses that are no arrays."""
        plan = self._plans.get(tuple(targets))
        if plan is None:
            return REFUSED
        done: Step | int = plan.cycle(q, {name: x.homogeneous if is_pose(x) else x for name, x in targets.items()})
        if isinstance(done, Step) or done >= 0:
            self._core.let_go(plan.slots)
            self._cycles[WITH_VALUES] = plan.request
        return done

    def _finished(self, flag: int, q: Any) -> Step:
        """A step after its tick."""
        try:
            self._gate[BUSY] = 1
            if (watch := self._core.watch) is not None:
                flag = watch.settle(flag)
            if self._core.finish(flag) < 0:
                self._core.refuse(q, None)
            self._core.finished()
            return Step(self._snapshot(), self._context)
        finally:
            self._gate[BUSY] = 0

    def _set_first(self, q: Any, v: Any, dt: Any, targets: dict[str, Any]) -> None:
        """Targets of a step whose other arguments are checked before."""
        self._require(q, v, dt)
        self.set(**targets)

    def set(self, **values: Any) -> None:
        """Set the targets of several items in one call: all are checked before any is written.

            controller.set(hand=pose, posture=q)                      # items by name: their targets
            controller.set(ball={"pose": pose, "velocity": twist})    # other values of an item

        Targets that follow each other in every tick cost a third of what setting them one by one does.

        Args:
            values: of each item its target, or where it has none its only value; or a dictionary of its values.

        Raises:
            UnknownNameError: no such item, or no such value. ShapeError: an item without a target; no value of it.
            NotFiniteError, RotationError, RangeError: no value of it. Nothing is changed.
        """
        plan = self._plans.get(tuple(values))
        if plan is None:
            plan = self._core.together.plan(values)
        if plan is not None:
            for value, place, shape in zip(values.values(), plan.places, plan.shapes):  # noqa: B905 (as many of each)
                if type(value) is _Array:
                    if value.dtype is not _FLOAT or value.shape != shape:
                        break
                    place[:] = value.tobytes()
                elif is_pose(value):
                    place[:] = value.homogeneous.tobytes()
                else:
                    break
            else:
                if plan.take():
                    if self._core.first:
                        self._core.let_go(plan.slots)
                    return
        self._core.together.carefully(values)

    def reset(self, q: Any = None, v: Any = None) -> None:
        """Start anew: the last command becomes ``v`` (default zero) and the solver forgets its active set.

        With ``q``, inputs that are taken from the first configuration and that nobody has set since (held
        poses, default targets) are taken from ``q``; without it, from the next step.

        Raises:
            ShapeError, NotFiniteError, RotationError: bad input; the controller is unchanged.
        """
        velocity = np.zeros(self._v_shape) if v is None else validation.real_array("v", v, self._v_shape)
        self._core.begin(None if q is None else self.stack.robot.configuration("q", q), velocity)

    def clone(self) -> Self:
        """Another controller of the same compiled stack, with its own memory and this one's values and last command.

        Its solver and sensors start as after a reset. Nothing is read from disk or compiled.
        """
        return self._copy(self._artifact, self._core.assembly.twin())

    def settled(self) -> Self:
        """The same for what needs a library: it waits for one in the making, see :meth:`wbc.Stack.compile`."""
        artifact = self._artifact.settled(wait=True)
        return self._copy(artifact, None if artifact is not self._artifact else self._core.assembly.twin())

    def _copy(self, artifact: Artifact, assembly: CompiledTick | None) -> Self:
        out = type(self)(self.stack, artifact, self.solver, assembly)
        out._core.assume(self._core)
        return out

    def __reduce_ex__(self, protocol: Any) -> Any:
        reason = "lives in the memory of its process; pickle controller.stack, and compile it there"
        raise PicklingError("controller", self.stack.robot.name, reason)

    def qp(self) -> QP:
        """The QP at the buffers' present values: at the configuration of the last step (before it: the neutral one),
        with acceleration bounds about the last command.

        Raises:
            SolverError: run-time values still wait for the first configuration.
        """
        if self._core.waiting:
            raise SolverError("qp", None, "needs the first configuration; call step(q) or reset(q) first")
        self._core.assembly.unbend()
        return self._core.tick.qp()

    @property
    def backend(self) -> str:
        """``native`` or ``vm``, as asked for: the second of a stack that answered at once, see :attr:`tier`."""
        return self._artifact.backend

    @property
    def tier(self) -> str:
        """What ticks run now, to the same bits: ``native``: code that was compiled for the stack; ``vm``: code that all
        stacks share, with the rows on CasADi's virtual machine.
        """
        return self._core.assembly.tier

    @property
    def may_change(self) -> bool:
        """Whether a tick may change over from ``vm`` to ``native`` code. A loop under a deadline that must not spend
        what the first native tick costs more, some hundred microseconds, sets it to false; true lets the next change.

        Raises:
            ShapeError: no bool.
        """
        return self._core.may_change

    @may_change.setter
    def may_change(self, may: bool) -> None:
        self._core.permit(validation.flag("may_change", may))

    @property
    def last_command(self) -> Array:
        """Velocity that the next step counts accelerations from, a copy."""
        return self._core.tick.v_last[: self._v_shape[0]].copy()

    def __repr__(self) -> str:
        return f"<Controller, {self.solver} ({self.backend}), of {self.stack!r}>"

    def __str__(self) -> str:
        core = self._core
        return describe(self.stack, core.layout, core.handles, f"solver {self.solver} ({self.backend})")

    @property
    def policy(self) -> Policy:
        """What happens where rows conflict or an answer cannot be certified, see :class:`wbc.Policy`.

        Raises:
            ShapeError: no policy. SolverError: the controller records; a recording has one policy; an escape in a
                stack of strict levels.
        """
        return self._core.fallback.policy

    @policy.setter
    def policy(self, policy: Policy) -> None:
        if not isinstance(policy, Policy):
            raise ShapeError("policy", policy, "expected a wbc.Policy")
        if self._core.recording is not None:
            raise SolverError("policy", policy, "cannot change while the controller records")
        if policy.escape and self._core.layout.cascade:
            raise SolverError("policy", policy, "only stacks of one level have an escape")
        self._core.follow(policy)

    @property
    def iteration_cap(self) -> int | None:
        """Iterations of the QP solver that a tick may take, or None for as many as it takes (the default).

        A tick whose search the cap ends has the status ``capped``. It commands

            v = v_brake + s (v_found - v_brake),

        v_brake bringing every joint to rest as fast as its bounds allow, v_found the solver's last iterate, clipped
        into the bounds, and s in [0, 1] as large as no row leaves its sides by it. So bounds hold, rows that v_brake
        satisfies hold, and others are not missed by more than v_brake misses them. The next tick goes on from the
        active set that was reached. Rows of a warm start are put in without counting.

        Raises:
            RangeError: not None and no integer >= 1. SolverError: a cap where the tick is not native with daqp.
        """
        cap = int(self._core.tick.cap[0])
        return cap if cap > 0 else None

    @iteration_cap.setter
    def iteration_cap(self, cap: int | None) -> None:
        if cap is None:
            self._core.tick.cap[0] = 0.0
            return
        if isinstance(cap, bool) or not isinstance(cap, int):
            raise RangeError("iteration_cap", cap, "expected an integer >= 1, or None for no cap")
        validation.scalar("iteration_cap", cap, low=1.0)
        if not isinstance(self._core.tick, CompiledTick):
            reason = f"only the native tick with daqp can be capped, this one is {self.backend} with {self.solver}"
            raise SolverError("iteration_cap", cap, reason)
        self._core.tick.cap[0] = float(cap)

    def pairs(self, name: str) -> tuple[tuple[str, str, float], ...]:
        """What the sensed rows of an item were about in the last tick: names of both bodies, distance [m].

        Raises:
            UnknownNameError: no such item.
        """
        validation.one_of("item", name, self._core.handles)
        return next((item.sensor.pairs() for item in self._core.measured if item.handle.item_name == name), ())

    def _prepare(self, q: Any, v: Any, dt: Any) -> None:
        """Check everything before anything is changed; the first configuration, where it is waited for."""
        configuration = self._require(q, v, dt)
        if self._core.waiting:
            self._core.take_first(configuration)
        if self._core.may_change:
            self._core.assembly.change_over()

    def _require(self, q: Any, v: Any, dt: Any) -> Array:
        """All arguments of a step are good; the configuration."""
        if dt is not None:
            low, high = self.stack.dt_range
            validation.scalar("dt", dt, low=low, high=high, unit="s")
        configuration = np.asarray(self.stack.robot.configuration("q", q))
        if v is not None:
            validation.real_array("v", v, self._v_shape)
        return configuration


def core_of(controller: CompiledStack) -> Core:
    """What a controller is inside, for the packages above this one."""
    return controller._core


_HEAD = ("item", "kind", "level", "weight", "gain or rate", "rows", "unit", "on")


def describe(stack: Declaration, layout: Layout, handles: Mapping[str, Handle], solver: str) -> str:
    """The table as text."""
    robot = stack.robot
    lines = [_row(handles[name], block) for name, block in layout.blocks.items()]
    widths = [max(len(r[k]) for r in [_HEAD, *lines]) for k in range(len(_HEAD))]
    head = (
        f"{robot.name}: {robot.nv} degrees of freedom, dt {stack.dt:g} s "
        f"({stack.dt_range[0]:g} to {stack.dt_range[1]:g}), {solver}, "
        f"characteristic length {stack.length:.3g} m, damping {stack.damping:g}"
    )
    text = [head]
    for r in [_HEAD, tuple("-" * w for w in widths), *lines]:
        text.append("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip())
    return "\n".join(text)


def _row(handle: Handle, block: Block) -> tuple[str, ...]:
    speed = "gain" if block.form == "task" else "rate"
    rate = f"{getattr(handle, speed):g} 1/s" if speed in block.slots else "-"
    kind_of_row = "minimised" if block.entry.level > 0 else "hard" if block.entry.hard else "soft"
    if "price" in block.slots:
        kind_of_row = f"soft, {handle.get('price'):g}"
    weight = f"{handle.get('weight'):g}" if block.form == "task" else kind_of_row
    units = ", ".join(dict.fromkeys(r.unit or "1" for r in block.rows))
    mask = handle.mask
    rows = f"{len(block.rows)}" if mask.all() else f"{int((mask > 0).sum())} of {len(block.rows)}"
    kind = type(block.entry.item).__name__
    return (
        block.entry.name,
        kind,
        str(block.entry.level),
        weight,
        rate,
        rows,
        units,
        "yes" if handle.enabled else "no",
    )
