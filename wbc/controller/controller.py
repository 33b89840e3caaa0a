"""The controller: validates, writes flat buffers, makes one call, wraps the report."""

from __future__ import annotations

import functools
import os
import pathlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import export, validation
from wbc.controller import hooks
from wbc.controller.fallback import Fallback
from wbc.controller.handle import Directions, Handle
from wbc.controller.native import NativeTick
from wbc.controller.policy import Policy
from wbc.controller.ramps import Ramps
from wbc.controller.report import BAD_V
from wbc.controller.solved import SolvedTick
from wbc.controller.step import Context, Step
from wbc.controller.table import describe
from wbc.controller.tick import Assembly
from wbc.controller.vectors import vectors
from wbc.controller.vm import VmAssembly
from wbc.errors import BusyError, PicklingError, RangeError, ShapeError, SolverError, UnknownNameError
from wbc.qp.problem import QP
from wbc.stack.artifact import Artifact
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Slot
from wbc.tasks.base import Constraint, Sensor
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.record.recorder import Recorder

_Array = np.ndarray
_FLOAT = np.dtype(np.float64)

#: How far an export's commands may be from those of the tick that it is [rad/s, m/s], and from those of another solver:
#: the native tick refines answers whose error it cannot bound by a tenth of that
SAME, SIMILAR = 1e-9, 1e-6


def assembly_of(stack: Declaration, artifact: Artifact) -> Assembly:
    """The native tick, or the virtual machine's.

    Raises:
        SolverError: the artifact has neither.
    """
    if artifact.library is not None:
        return NativeTick(artifact.library, artifact.layout)
    if artifact.program is not None:
        return VmAssembly(artifact.program, stack, artifact.layout)
    raise SolverError("artifact", artifact, "has neither a library nor a program")


class Controller:
    """A compiled stack with its run-time values. Made by :meth:`wbc.Stack.compile`.

    Each controller has its own memory, see :meth:`clone`; one controller must not be stepped from two threads at once.

    Attributes:
        stack: the declaration that it was compiled from.
        solver: name of the QP solver.
        backend: ``native`` or ``vm``.
        cached: the compiled stack was found in the cache.
    """

    def __init__(self, stack: Declaration, artifact: Artifact, solver: str, assembly: Assembly | None = None) -> None:
        layout = artifact.layout
        self.stack, self.solver, self.cached = stack, solver, artifact.cached
        self.backend = "native" if artifact.library is not None else "vm"
        self._artifact, self.layout = artifact, layout
        self.row_costs: Array = 1.0 / layout.row_scales(stack) ** 2
        self._assembly = assembly_of(stack, artifact) if assembly is None else assembly
        native = self._assembly if isinstance(self._assembly, NativeTick) and solver == "daqp" else None
        self.tick: NativeTick | SolvedTick = native or SolvedTick(self._assembly, stack, layout, solver)
        self._fallback = Fallback(self.tick, self._assembly, stack, layout)
        self._call: Callable[[], int] = self.tick.step
        if isinstance(self.tick, NativeTick):
            self._call = functools.partial(self.tick.step_function, self.tick.pointer)
        self._q, self._v_in, self._use_v = self.tick.q, self.tick.v_in[: layout.nv], self.tick.use_v
        self._context = Context(stack, layout, self._assembly)
        # of all ways to copy some hundred numbers into something immutable, the fastest
        self._snapshot = self.tick.state.data.cast("B").tobytes
        self._q_shape, self._v_shape = (layout.nq,), (layout.nv,)
        self._busy, self._resets, self.ramps = False, 0, Ramps()
        self._recorder: Recorder | None = None
        #: inputs that follow the first configuration, with their items, and those of them that it still has to fill
        self._first: dict[Slot, str] = {}
        self._waiting: dict[Slot, str] = {}
        self._handles = {name: Handle(self, block) for name, block in layout.blocks.items()}
        self.directions = Directions(layout, self.tick, self._handles)
        #: sensors with the handles of their items
        self._sensors = [(self._sensor(name), self._handles[name]) for name in layout.blocks if self._is_sensed(name)]
        self.tick.dt[0] = stack.dt
        self.tick.q[:] = stack.robot.neutral
        self.tick.check()
        #: the next step has more to do than to copy q: defaults to take from it, or dt to set back
        self._slow = True
        for name, handle in self._handles.items():
            handle.apply()
            for slot in layout.blocks[name].slots.values():
                self._set_default(name, slot)

    def step(self, q: Any, v: Any = None, dt: Any = None) -> Step:
        """One control cycle: the command v for the next dt seconds.

            minimise   sum over task rows of w (J v + gain e + de/dt)^2 + damping |v|^2
            subject to the constraints' rows and bounds

        Args:
            q: configuration [nq]; any real array or sequence.
            v: measured velocity [nv] that acceleration bounds are counted from; default: the last command
                (zero after a reset).
            dt: time until the next command [s], within ``stack.dt_range``; default: the declared one.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: bad input; the controller is unchanged.
            BusyError: another thread is within ``step`` of this controller.
        """
        if self._busy:
            raise BusyError("step", self.stack.robot.name, "this controller is in use by another thread; clone() it")
        try:
            self._busy = True
            if slow := dt is not None or self._slow:
                self._prepare(q, v, dt)
            if not (type(q) is _Array and q.dtype is _FLOAT and q.shape == self._q_shape):
                q = validation.real_array("q", q, self._q_shape)
            if v is not None and not (type(v) is _Array and v.dtype is _FLOAT and v.shape == self._v_shape):
                v = validation.real_array("v", v, self._v_shape)
            if self._sensors:
                self._sense(q)
            # What may raise is over
            if v is not None:
                self._v_in[:] = v
                self._use_v[0] = 1.0
            self._q[:] = q
            if slow:
                self._advance(dt)
            if (flag := self._call()) and self.finish(flag) < 0:
                self._refuse(q, v)
            return Step(self._snapshot(), self._context)
        finally:
            self._busy = False

    def reset(self, q: Any = None, v: Any = None) -> None:
        """Start anew: the last command becomes ``v`` (default zero) and the solver forgets its active set.

        With ``q``, inputs that are taken from the first configuration and that nobody has set since (held
        poses, default targets) are taken from ``q``; without it, from the next step.

        Raises:
            ShapeError, NotFiniteError, RotationError: bad input; the controller is unchanged.
        """
        velocity = np.zeros(self.layout.nv) if v is None else validation.real_array("v", v, self._v_shape)
        self.begin(None if q is None else self.stack.robot.configuration("q", q), velocity)

    def record(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Recorder:
        """Record every tick into a file from now on, until the recorder is closed; see :func:`wbc.replay`.

        Args:
            overwrite: a file that is there may be replaced.

        Raises:
            RecordingError: the file is there or cannot be written, or the controller records already.
        """
        recorder: Recorder = hooks.record(self, path, overwrite)
        return recorder

    def clone(self) -> Controller:
        """Another controller of the same compiled stack, with its own memory and this one's values and last command.

        Its solver and sensors start as after a reset. Nothing is read from disk or compiled.
        """
        out = Controller(self.stack, self._artifact, self.solver, self._assembly.twin())
        for name, handle in out._handles.items():
            handle.assume(self._handles[name])
        for name in ("q", "v_last", "p", "cap", "dt", "weight", "enabled", "bound_enabled"):
            getattr(out.tick, name)[:] = getattr(self.tick, name)
        out.tick.check()
        out.policy = self.policy
        out.ramps.assume(self.ramps, out._handles)
        if self._fallback.prepared:
            out.prepare()
        out._first, out._waiting, out._slow = dict(self._first), dict(self._waiting), self._slow
        return out

    def __reduce_ex__(self, protocol: Any) -> Any:
        reason = "lives in the memory of its process; pickle controller.stack, and compile it there"
        raise PicklingError("controller", self.stack.robot.name, reason)

    def again(self) -> Step:
        """A tick on the buffers as they are, which a replay has written."""
        if (flag := self._call()) and self.finish(flag) < 0:
            self._refuse(self._q.copy(), self._v_in.copy())
        return Step(self._snapshot(), self._context)

    def __getitem__(self, name: str) -> Handle:
        try:
            return self._handles[name]
        except (KeyError, TypeError):
            raise UnknownNameError("item", name, self._handles) from None

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._handles

    def qp(self) -> QP:
        """The QP at the buffers' present values: at the configuration of the last step (before it: the neutral one),
        with acceleration bounds about the last command.

        Raises:
            SolverError: run-time values still wait for the first configuration.
        """
        if self._waiting:
            raise SolverError("qp", None, "needs the first configuration; call step(q) or reset(q) first")
        return self.tick.qp()

    @property
    def last_command(self) -> Array:
        """Velocity that the next step counts accelerations from, a copy."""
        return self.tick.v_last[: self.layout.nv].copy()

    def __str__(self) -> str:
        return describe(self.stack, self.layout, self._handles, f"solver {self.solver} ({self.backend})")

    @property
    def policy(self) -> Policy:
        """What happens where rows conflict or an answer cannot be certified, see :class:`wbc.Policy`.

        Raises:
            ShapeError: no policy. SolverError: the controller records; a recording has one policy.
        """
        return self._fallback.policy

    @policy.setter
    def policy(self, policy: Policy) -> None:
        if not isinstance(policy, Policy):
            raise ShapeError("policy", policy, "expected a wbc.Policy")
        if self._recorder is not None:
            raise SolverError("policy", policy, "cannot change while the controller records")
        self._fallback.policy = policy

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
        cap = int(self.tick.cap[0])
        return cap if cap > 0 else None

    @iteration_cap.setter
    def iteration_cap(self, cap: int | None) -> None:
        if cap is None:
            self.tick.cap[0] = 0.0
            return
        if isinstance(cap, bool) or not isinstance(cap, int):
            raise RangeError("iteration_cap", cap, "expected an integer >= 1, or None for no cap")
        validation.scalar("iteration_cap", cap, low=1.0)
        if not isinstance(self.tick, NativeTick):
            reason = f"only the native tick with daqp can be capped, this one is {self.backend} with {self.solver}"
            raise SolverError("iteration_cap", cap, reason)
        self.tick.cap[0] = float(cap)

    def export(
        self,
        folder: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        solver_source: bool | str | os.PathLike[str] = False,
        states: int = 1000,
    ) -> pathlib.Path:
        """Write the tick as self-contained C99, with its QP solver, a header, build files and a check.

            controller.reset(q)
            controller.export("arm_tick")           # then: make -C arm_tick run

        The values that the controller has now (targets, gains, weights, switches, the cap) are those that the C code
        begins with. Nothing is compiled, and any backend will do; the C code is the native tick. docs/export.md.

        Args:
            folder: where to; it must be empty or not there.
            overwrite: an export that is there is replaced.
            solver_source: the solver's source in place of the library for this platform: True fetches it from the
                package index, or the path of its archive. Its hash is checked.
            states: how many states the check has, with this controller's commands; other backends than the native one
                give those of them that they solve with certainty.

        Raises:
            ExportError: the folder is not empty or cannot be written.
            SolverError: run-time values still wait for the first configuration.
            SolverSourceError: the solver cannot be had. RangeError: ``states`` is no integer >= 1.
        """
        from wbc import __version__

        if isinstance(states, bool) or not isinstance(states, int) or not 1 <= states < 2**31:
            raise RangeError("states", states, "expected an integer >= 1")
        export.checked_folder(folder, overwrite)
        self.require_values()
        tick, layout, robot = self.tick, self.layout, self.stack.robot
        cost = self.row_costs.copy()
        for block in layout.of_form("task"):
            cost[block.span] *= block.entry.item.row_weights(robot)
        snapshot = export.Snapshot(
            self.stack,
            layout,
            tick.q.copy(),
            tick.p.copy(),
            tick.weight.copy(),
            cost,
            tick.enabled.copy(),
            tick.bound_enabled.copy(),
            float(tick.cap[0]),
            __version__,
            vectors(self.clone(), states),
            f"the {self.backend} tick with {self.solver}",
            SAME if self.backend == "native" and self.solver == "daqp" else SIMILAR,
        )
        return export.write(snapshot, folder, overwrite, solver_source)

    # What handles and the packages above need; not for users

    def start_ramp(self, handle: Handle, weight: float, seconds: float) -> None:
        """See :meth:`Handle.ramp`."""
        self.ramps.start(handle, weight, seconds)
        self._slow = True

    def prepare(self) -> None:
        """Import and make now what the policy may need in a tick."""
        self._fallback.prepare()

    def finish(self, flag: int) -> int:
        """What the policy adds to a tick that ended with ``flag``; negative: refused."""
        return self._fallback.finish(flag)

    def begin(self, configuration: Array | None, velocity: Array) -> None:
        """A reset with checked values."""
        if configuration is not None:
            self._initialise(self._first, configuration)
        self._waiting = {} if configuration is not None else dict(self._first)
        self.tick.v_last[: self.layout.nv] = velocity
        self.tick.reset()
        for sensor, _ in self._sensors:
            sensor.reset()
        self._resets += 1
        self._slow = True

    def write(self, slot: Slot, numbers: Array) -> None:
        """Write validated numbers of an input; it no longer follows the first configuration."""
        self.tick.p[slot.span] = numbers
        if slot in self._first:
            self._let_go(slot)

    def write_pose(self, slot: Slot, matrix: Array) -> bool:
        """Write a pose from its homogeneous matrix [4, 4]; False, and nothing written, where :meth:`write` has to."""
        if not self._assembly.put_pose(slot.start, matrix):
            return False
        if slot in self._first:
            self._let_go(slot)
        return True

    def _let_go(self, slot: Slot) -> None:
        """An input was set, so it no longer follows the first configuration."""
        del self._first[slot]
        self._waiting.pop(slot, None)

    def require_value(self, slot: Slot, field: str) -> None:
        """Values that wait for the first configuration cannot be read before it."""
        if slot in self._waiting:
            raise SolverError(field, None, "is taken from the first configuration; call step(q) or reset(q) first")

    def require_values(self) -> None:
        """No value waits for the first configuration."""
        for slot, name in self._waiting.items():
            self.require_value(slot, f"{name}.{slot.input.name}")

    def pairs(self, name: str) -> tuple[tuple[str, str, float], ...]:
        """What the sensed rows of an item were about in the last tick: names of both bodies, distance [m].

        Raises:
            UnknownNameError: no such item.
        """
        validation.one_of("item", name, self._handles)
        return next((sensor.pairs() for sensor, handle in self._sensors if handle.item_name == name), ())

    def _is_sensed(self, name: str) -> bool:
        item = self.stack[name].item
        return isinstance(item, Constraint) and item.sensed_rows(self.stack.robot) > 0

    def _sensor(self, name: str) -> Sensor:
        item, slots = self.stack[name].item, self.layout.blocks[name].slots
        assert isinstance(item, Constraint)
        return item.sensor(self.stack.robot, {key: self.tick.p[slot.span] for key, slot in slots.items()})

    def _sense(self, q: Array) -> None:
        """Measure what enabled items sense; not at numbers that the tick will refuse."""
        if not np.isfinite(q).all():
            return
        for sensor, handle in self._sensors:
            if handle.enabled:
                sensor.sense(q)

    # The first configuration

    def _set_default(self, name: str, slot: Slot) -> None:
        value = slot.input.default
        if value is None:
            self._waiting[slot] = self._first[slot] = name
            return
        if slot.input.name == "rate":
            value = min(float(value), 1.0 / self.stack.dt_range[1])
        self.tick.p[slot.span] = self._handles[name].checked(slot.input.name, value)

    def _initialise(self, slots: Mapping[Slot, str], q: Array) -> None:
        values: list[tuple[Slot, Array]] = []
        initial = {name: self.stack[name].item.initial(self.stack.robot, q) for name in set(slots.values())}
        for slot, name in slots.items():
            wanted = slot.input.name
            if wanted not in initial[name]:
                raise SolverError(f"{name}.{wanted}", None, "has no default value; set it before step")
            values.append((slot, self._handles[name].checked(wanted, initial[name][wanted])))
        for slot, numbers in values:
            self.tick.p[slot.span] = numbers

    # Off the fast path

    def _prepare(self, q: Any, v: Any, dt: Any) -> None:
        """Check everything before anything is changed; the first configuration, where it is waited for."""
        if dt is not None:
            low, high = self.stack.dt_range
            validation.scalar("dt", dt, low=low, high=high, unit="s")
        configuration = self.stack.robot.configuration("q", q)
        if v is not None:
            validation.real_array("v", v, self._v_shape)
        if self._waiting:
            self._initialise(self._waiting, configuration)
            self._waiting = {}

    def _advance(self, dt: Any) -> None:
        """Another dt than the last, and the ramps' next values."""
        step = self.stack.dt if dt is None else float(dt)
        self.tick.dt[0] = step
        self.ramps.advance(step)
        self._slow = dt is not None or bool(self.ramps)

    def _refuse(self, q: Any, v: Any) -> None:
        """Say what was wrong with inputs that the tick refused."""
        self.stack.robot.configuration("q", q)
        validation.real_array("v", v, (self.stack.robot.nv,))
        raise SolverError("step", BAD_V, "the tick refused its inputs")
