"""The native tick: one library, one block of memory, one call."""

from __future__ import annotations

import ctypes
import functools
import pathlib
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.errors import SolverError
from wbc.native.arrays import ARRAY_MAKERS, PLAIN_ARRAYS
from wbc.native.builtin import builtin, builtin_like, builtin_of_one, builtin_of_some, places_of
from wbc.native.library import load_library
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.tick.buffers import INFINITE, OWN, REST_RATE, Buffers, TaskRows
from wbc.tick.row_follower import RowFollower
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.qp.problem import QP

#: What a tick with its values in one call returns where an argument is refused, as in ``native/builtins.h``
REFUSED = -100


def aligned(count: int) -> Array:
    """Zeros that begin where a line of the processor's cache does."""
    raw = np.zeros(count + 8)
    shift = (-raw.ctypes.data % 64) // 8
    return raw[shift : shift + count]


class CompiledTick(Buffers, ABC):
    """Memory of one controller and the functions of a library that works on it; and the QP at their values.

    Args:
        memory: begins with the fields of :class:`wbc.stack.memory.Memory`. pointer: what the functions take.

    Attributes:
        plain: not 0 for the linear model as it is, without curvature.
    """

    def __init__(self, library: ctypes.PyDLL, layout: Layout, memory: Array, pointer: ctypes.c_void_p) -> None:
        self._library, self._layout, self._memory, self.pointer = library, layout, memory, pointer
        self._library.wbc_tick_init(self.pointer)
        places = Memory(layout)
        view = functools.partial(places.view, self._memory)
        self.q, self.p, self.dt, self.cap = view("q"), view("p"), view("dt"), view("cap")
        self.v_last, self.v_in, self.use_v = view("v_last"), view("v_in"), view("use_v")
        self._command, self._dofs = layout.command, layout.nv
        self._slewed, self._elastic = layout.slewed, layout.elastic
        if layout.command == "torque":
            self._torque = places["torque"]
        if layout.command != "velocity":
            self.kept = view("kept")
        self.weight, self.enabled, self.bound_enabled = view("weight"), view("enabled"), view("bound_enabled")
        self.report, self.state = self._memory[: places.report], self._memory[: places.state]
        self._H, self._g, self._low, self._high = view("H"), view("g"), view("low"), view("high")
        self._A = view("A").reshape(layout.general_rows, layout.variables)
        self._unusable, self.plain = view("unusable"), view("plain")
        self._desired, self._factor = view("desired"), view("factor")
        #: what rows report, and what stands for numbers that have no value, as in ``tidy`` of ``native/certify.h``
        self._undefined = [
            (view(name), instead)
            for name, instead in (("error", np.inf), ("factor", 0.0), ("margin", -np.inf), ("margin_factor", 0.0))
        ]
        self._sides = view("free_low"), view("free_high")
        self._give, self.bend = view("give"), view("bend")
        self.curving, self.stopped, self.shortened = view("curving"), view("stopped"), view("shortened")
        self.shortfall, self.pressed = view("shortfall"), view("pressed")
        self._library.wbc_tick_find_lost.restype = self._library.wbc_tick_ease.restype = ctypes.c_double
        self.step_function = self._library.wbc_tick_step
        #: one tick; returns its flag
        self.call: Callable[[], int] = builtin(self._library.wbc_python_step, self.pointer.value or 0)
        #: arrays that native code has the addresses of
        self._kept: list[Any] = []
        #: address of a ``wbc_recording`` of ``native/builtins.h``, into which ticks with values in one call go; 0: none
        self.recording = np.zeros(1, np.int64)
        #: a ``wbc_watch`` of ``native/watch.h``: the sensors that measure before such ticks, none at first
        self.watch = np.zeros(2, np.int64)
        self._watch_at = ctypes.c_void_p(self.watch.ctypes.data)
        #: a copy of :attr:`state`, and where the layout has ``moves`` of q (+) v dt after it
        self.snapshot: Callable[[], bytes] = builtin(
            self._library.wbc_python_kept, self._cycle(np.zeros(0), np.zeros((0, 3)), [], [])
        )

    def step(self) -> int:
        return self.call()

    def taker(self, staged: Array, plan: np.ndarray) -> Callable[[], int]:
        """What checks values that wait in ``staged`` and writes them to ``p``; 0, and nothing written, where one is
        refused.

        Args:
            plan: of each value what it is, where it goes in ``p``, how many numbers it has [count, 3].
        """
        table = np.ascontiguousarray(plan, np.intc)
        request = np.array([self.pointer.value, staged.ctypes.data, table.ctypes.data, len(table)], np.int64)
        self._kept += [staged, table, request]
        return builtin(self._library.wbc_python_take, request.ctypes.data)

    def cycler(
        self, staged: Array, plan: np.ndarray, names: Sequence[str], step: Callable[[bytes, Any], Any], context: object
    ) -> tuple[Callable[[Any, dict[str, Any]], Any], int]:
        """What ticks at a configuration with these values in one call: of (q, values by name), arrays of doubles.
        Returns a step where the tick is solved, else its flag; a negative one, and nothing is changed, where an
        argument is refused or names are others or in another order. And what :meth:`stepper` knows it by.

        Args:
            staged, plan: as of :meth:`taker`. names: of the values.
            step, context: the type of what is returned, made of :attr:`snapshot` and of this, which it keeps in slots.
        """
        known = [sys.intern(name) for name in names]
        data = self.snapshot()
        places = places_of(step(data, context), (context, data))
        request = self._cycle(staged, plan, known, [id(step), id(context), *places])
        self._kept += [step, context]
        return builtin_of_some(self._library.wbc_python_cycle, request), request

    def stepper(self, gate: np.ndarray, cycle: int, method: Any, finish: Any) -> tuple[Callable[..., Any], np.ndarray]:
        """What stands for a controller's ``step``: ticks of what :meth:`cycler` made, without Python between them, and
        the table of these: the second number is of steps without values, the third of those with.

        Args:
            gate: three numbers; where one is not 0 ``method`` does the step. cycle: of no values.
            finish: ends a step whose tick has a flag (flag, q).
        """
        table = np.array([gate.ctypes.data, cycle, cycle], np.int64)
        self._kept += [gate, table]
        about = (table.ctypes.data, method, finish)
        return builtin_like(method, "q, v=None, dt=None, **targets", self._library.wbc_python_steps, about), table

    def follower(self, places: np.ndarray, rows: slice) -> RowFollower:
        """What ticks along rows of inputs, where the layout has ``moves``; arguments as of :class:`RowFollower`."""
        cycle = self._cycle(np.zeros(0), np.zeros((0, 3)), [], [])
        return RowFollower(self._library.wbc_tick_follow, cycle, places, rows)

    def part(self, first: int, count: int) -> Callable[[bytes], Array]:
        """What makes an array of ``count`` numbers of :attr:`snapshot` from number ``first`` on, read-only, without a
        copy.
        """
        request = np.array([*ARRAY_MAKERS, 8 * first, count], np.int64)
        self._kept.append(request)
        return builtin_of_one(self._library.wbc_python_part, request.ctypes.data)

    def _cycle(self, staged: Array, plan: np.ndarray, names: Sequence[str], step: Sequence[int]) -> int:
        """Address of a ``wbc_cycle`` of ``native/builtins.h``; ``step``: what it has of what is returned."""
        table, moves = np.ascontiguousarray(plan, np.intc).reshape(-1, 3), np.array(self._layout.moves, np.intc)
        # Addresses of objects of Python are their identities
        objects = np.array([id(name) for name in names], np.int64)
        request = np.array(
            [
                self.pointer.value, self.recording.ctypes.data, self.watch.ctypes.data, self.q.ctypes.data,
                staged.ctypes.data, table.ctypes.data, len(table), self._layout.nq, self.state.nbytes,
                self.state.ctypes.data, moves.ctypes.data, len(moves), self._layout.nq if len(moves) else 0,
                objects.ctypes.data, *PLAIN_ARRAYS, *step,
            ],
            np.int64,
        )  # fmt: skip
        self._kept += [staged, table, moves, request, objects, names]
        return request.ctypes.data

    def reset(self) -> None:
        self._library.wbc_tick_reset(self.pointer)

    def watch_sensors(self, sensors: np.ndarray) -> None:
        """Sensors measure from now on before each tick with its values in one call, which then looks at its command.

        Args:
            sensors: a ``wbc_sensor`` of ``native/watch.h`` each [count, 10].
        """
        self._kept.append(sensors)
        self.watch[:] = sensors.ctypes.data, len(sensors)

    def sense(self) -> None:
        """Measure at q what enabled items sense."""
        self._library.wbc_tick_sense(self.pointer, self._watch_at)

    def missed(self) -> int:
        """The most that a pair without a row uses, at the reported command, of what its row would allow:
        :data:`wbc.proximity.missing.LITTLE` to ``INWARD``.
        """
        return int(self._library.wbc_tick_missed(self.pointer, self._watch_at))

    def assemble(self) -> None:
        """Rows and QP only; no reported number is NaN."""
        self._library.wbc_tick_assemble(self.pointer)
        for reported, instead in self._undefined:
            reported[np.isnan(reported)] = instead

    def solve(self) -> int:
        """Active-set solution of the assembled QP only."""
        return int(self._library.wbc_tick_solve(self.pointer))

    def certify(self) -> None:
        """Certificate of the solved QP only."""
        self._library.wbc_tick_certify(self.pointer)

    def look_ahead(self) -> None:
        """Margins after the step only."""
        self._library.wbc_tick_look_ahead(self.pointer)

    def hurries(self) -> bool:
        """Whether the reported command goes as fast as it may and falls short, by ``shortfall``."""
        return bool(self._library.wbc_tick_hurries(self.pointer))

    def find_lost(self, everything: bool) -> float:
        """What equality rows lose at the reported command, into the report; the largest as a rate, in row units.

        Args:
            everything: what they miss of moved sides, too, which is not what the order of sacrifice has taken.
        """
        return float(self._library.wbc_tick_find_lost(self.pointer, int(everything)))

    def ease(self, limits: bool) -> tuple[float, Array, Array]:
        """Room for closed loops in the QP at hand, which has no answer: (what their rows have, in their units, 0 where
        they do not give way last; lower and upper bounds of variables and rows).

        Args:
            limits: limits of motion give way, too, as far as loops need it; by how much is in the report.
        """
        room = float(self._library.wbc_tick_ease(self.pointer, int(limits)))
        return (room, *self._bounds())

    def _bounds(self) -> tuple[Array, Array]:
        low, high = self._low.copy(), self._high.copy()
        low[low <= -INFINITE], high[high >= INFINITE] = -np.inf, np.inf
        return low, high

    def check(self) -> int:
        """Take q and a measured velocity over, or put the last good q back; negative for refused inputs."""
        return int(self._library.wbc_tick_check(self.pointer))

    def commanded(self, v: Array, sound: bool) -> None:
        """What follows from a command in the report: torques, and the velocity that the next tick counts from.

        Args:
            sound: it is a certified answer, whose wrenches the next tick keeps if it has none.
        """
        if self._command == "velocity":
            self.v_last[:] = v
            return
        nv = self._dofs
        self._find_torques()
        if self._command == "torque":
            self.kept[:nv] = self.report[self._torque]
        self._library.wbc_tick_arrive(self.pointer)
        if sound:
            self.kept[nv:] = v[nv:]

    def forget(self) -> None:
        """No wrenches are kept, and the last torques are not known."""
        self.kept[:] = 0.0
        self.kept[: self._dofs] = INFINITE

    def rewind(self) -> None:
        """Before the tick is done again: accelerations and torques count from where they did."""
        self.v_last[:] = self.v_in
        self.unbend()
        self.kept[self._slewed[1]] = self.p[self._slewed[0]]

    def unbend(self) -> None:
        """The rows as they are at q."""
        for name in OWN:
            getattr(self, name)[:] = 0.0

    def rest(self, lower: Array, upper: Array, coasting: Array) -> Array:
        """The command within simple bounds that is nearest to rest: of velocities ``coasting``; else at once or, on a
        floating base, by damping.
        """
        nearest = coasting.copy()
        if self._command != "velocity":
            nv = self._dofs
            rate = REST_RATE if self._elastic else 1.0 / float(self.dt[0])
            nearest[:nv], nearest[nv:] = -rate * self.v_last[:nv], self.kept[nv:]
        return np.minimum(np.maximum(nearest, lower), upper)

    @property
    @abstractmethod
    def tier(self) -> str:
        """``native``: code of this stack alone; ``vm``: code that all stacks share, with rows on CasADi's virtual
        machine.
        """

    #: called by the thread that offers native code
    wake: Callable[[], None] = staticmethod(lambda: None)

    @property
    def offered(self) -> bool:
        """Native code waits for :meth:`change_over`."""
        return False

    def change_over(self) -> None:
        """To the native code that was offered, to the same bits, with the next tick; nothing without."""

    @abstractmethod
    def twin(self) -> CompiledTick:
        """Another one of the same code, with memory of its own."""

    def _find_torques(self) -> None:
        """Torques of the command into the report, where torques are commanded."""
        if self._layout.command == "torque":
            self._library.wbc_tick_torques(self.pointer)

    @property
    def usable(self) -> bool:
        """Numbers of the last assembly are finite and every simple bound leaves an interval."""
        return bool(self._unusable[0] == 0.0)

    def task_rows(self) -> TaskRows:
        """Rows of all levels in the last QP."""
        J = np.zeros((self._layout.task_rows, self._layout.variables))
        self._library.wbc_tick_task_rows(self.pointer, ctypes.c_void_p(J.ctypes.data))
        return TaskRows(J, self._desired.copy(), self._factor.copy())

    def curvature(self) -> Array | None:
        """Curvature in H of the last QP [nv, nv], before anything made H positive definite; None for none.

        Raises:
            SolverError: there is one level, whose code does not keep it.
        """
        if not self._layout.cascade:
            raise SolverError("curvature", "one level", "only stacks with strict levels keep this; see qp()")
        out = np.zeros((self._layout.variables, self._layout.variables))
        curved = self._library.wbc_tick_curvature(self.pointer, ctypes.c_void_p(out.ctypes.data))
        return out if curved else None

    def row_bounds(self) -> tuple[Array, Array]:
        """Bounds of the general rows in the last QP, those that are minimised at a level included."""
        low, high = (side.copy() for side in self._sides)
        low[low <= -INFINITE], high[high >= INFINITE] = -np.inf, np.inf
        return low, high

    def move_sides(self, change: Array) -> None:
        """Both sides of the general rows of the last QP, as ``bend_rows`` of ``native/bend.h`` moves them."""
        for side in self._sides:
            side += change

    def quadratic(self) -> tuple[Array, Array]:
        """(H, g) of :meth:`qp` until the next call; only the upper triangle of H counts."""
        self.assemble()
        nv = self._layout.variables
        return self._H[:, :nv], self._g[:nv]

    @functools.cached_property
    def _upper(self) -> np.ndarray:
        """Which entries of H the library writes."""
        nv = self._layout.variables
        return np.tri(nv, dtype=bool).T

    def qp(self) -> QP:
        """The QP at the buffers' values, before any relaxation: of the first level, where there are several."""
        from wbc.qp.problem import QP

        self.assemble()
        nv = self._layout.variables
        above = self._H[:, :nv]
        H = np.where(self._upper, above, above.T)
        return QP(H, self._g[:nv].copy(), *self._bounds(), self._A.copy(), self._give.copy())


class NativeTick(CompiledTick):
    """The tick of one stack, compiled with its rows.

    Where each field is in memory is checked against the layout, so that a library of another layout is refused.
    """

    def __init__(self, library: pathlib.Path | ctypes.PyDLL, layout: Layout) -> None:
        # Not CDLL: releasing the interpreter lock costs more than it can give a call of a few microseconds
        loaded = library if isinstance(library, ctypes.PyDLL) else load_library(library)
        loaded.wbc_tick_size.restype = loaded.wbc_tick_offset.restype = ctypes.c_longlong
        memory = aligned(int(loaded.wbc_tick_size()) // 8)
        Memory(layout).require(loaded.wbc_tick_offset, loaded._name)
        super().__init__(loaded, layout, memory, ctypes.c_void_p(memory.ctypes.data))

    def library_function(self, name: str, returns: Any, unlocked: bool = False) -> Any:
        """Another function of the library; ``unlocked``: it works long enough to be worth releasing the lock for."""
        library = ctypes.CDLL(self._library._name, handle=self._library._handle) if unlocked else self._library
        function = getattr(library, name)
        function.restype = returns
        return function

    @functools.cached_property
    def converge_function(self) -> Any:
        """One search; of a library that was compiled with inverse kinematics."""
        return self.library_function("wbc_tick_converge", None)

    @functools.cached_property
    def converge_many(self) -> Any:
        """Thousands of searches in one call."""
        return self.library_function("wbc_tick_converge_many", None, unlocked=True)

    tier = "native"

    def twin(self) -> NativeTick:
        return NativeTick(self._library, self._layout)
