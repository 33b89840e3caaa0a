"""The native tick: one library, one block of memory, one call."""

from __future__ import annotations

import ctypes
import functools
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np

from wbc.errors import SolverError
from wbc.native.builtin import builtin
from wbc.native.library import load_library
from wbc.qp.problem import QP
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.tick.buffers import INFINITE, Assembly, TaskRows
from wbc.validation import Array


class CompiledTick(Assembly):
    """Memory of one controller and the functions of a library that works on it; see
    :class:`wbc.tick.Buffers`.

    Args:
        memory: begins with the fields of :class:`wbc.stack.memory.Memory`. pointer: what the functions take.
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
        self._sides = view("free_low"), view("free_high")
        self._give, self.bend = view("give"), view("bend")
        self.curving, self.stopped, self.shortened = view("curving"), view("stopped"), view("shortened")
        self._library.wbc_tick_find_lost.restype = ctypes.c_double
        self.step_function = self._library.wbc_tick_step
        #: one tick; returns its flag
        self.call = builtin(self._library.wbc_python_step, self.pointer.value or 0)
        #: arrays that native code has the addresses of
        self._kept: list[np.ndarray] = []

    def step(self) -> int:
        return self.call()

    takes = True

    def taker(self, staged: Array, plan: np.ndarray) -> Callable[[], int]:
        table = np.ascontiguousarray(plan, np.intc)
        request = np.array([self.pointer.value, staged.ctypes.data, table.ctypes.data, len(table)], np.int64)
        self._kept += [staged, table, request]
        return builtin(self._library.wbc_python_take, request.ctypes.data)

    def reset(self) -> None:
        self._library.wbc_tick_reset(self.pointer)

    def assemble(self) -> None:
        """Rows and QP only."""
        self._library.wbc_tick_assemble(self.pointer)

    def solve(self) -> int:
        """Active-set solution of the assembled QP only."""
        return int(self._library.wbc_tick_solve(self.pointer))

    def certify(self) -> None:
        """Certificate of the solved QP only."""
        self._library.wbc_tick_certify(self.pointer)

    def look_ahead(self) -> None:
        """Margins after the step only."""
        self._library.wbc_tick_look_ahead(self.pointer)

    def find_lost(self, everything: bool) -> float:
        return float(self._library.wbc_tick_find_lost(self.pointer, int(everything)))

    def check(self) -> int:
        """Only refuse bad inputs, and take over a measured velocity."""
        return int(self._library.wbc_tick_check(self.pointer))

    def _find_torques(self) -> None:
        if self._layout.command == "torque":
            self._library.wbc_tick_torques(self.pointer)

    @property
    def usable(self) -> bool:
        """Numbers of the last assembly are finite and every simple bound leaves an interval."""
        return bool(self._unusable[0] == 0.0)

    def task_rows(self) -> TaskRows:
        self._require_levels("task_rows")
        J = np.zeros((self._layout.task_rows, self._layout.variables))
        self._library.wbc_tick_task_rows(self.pointer, ctypes.c_void_p(J.ctypes.data))
        return TaskRows(J, self._desired.copy(), self._factor.copy())

    def curvature(self) -> Array | None:
        self._require_levels("curvature")
        out = np.zeros((self._layout.variables, self._layout.variables))
        curved = self._library.wbc_tick_curvature(self.pointer, ctypes.c_void_p(out.ctypes.data))
        return out if curved else None

    def _require_levels(self, asked: str) -> None:
        """Code of one level makes H of its rows, and keeps no rows."""
        if not self._layout.cascade:
            raise SolverError(asked, "one level", "only stacks with strict levels keep this; see qp()")

    def row_bounds(self) -> tuple[Array, Array]:
        low, high = (side.copy() for side in self._sides)
        low[low <= -INFINITE], high[high >= INFINITE] = -np.inf, np.inf
        return low, high

    def quadratic(self) -> tuple[Array, Array]:
        self.assemble()
        nv = self._layout.variables
        return self._H[:, :nv], self._g[:nv]

    @functools.cached_property
    def _upper(self) -> np.ndarray:
        """Which entries of H the library writes."""
        nv = self._layout.variables
        return np.tri(nv, dtype=bool).T

    def qp(self) -> QP:
        self.assemble()
        nv = self._layout.variables
        above = self._H[:, :nv]
        H = np.where(self._upper, above, above.T)
        low, high = self._low.copy(), self._high.copy()
        low[low <= -INFINITE], high[high >= INFINITE] = -np.inf, np.inf
        return QP(H, self._g[:nv].copy(), low, high, self._A.copy(), self._give.copy())


class NativeTick(CompiledTick):
    """The tick of one stack, compiled with its rows.

    Where each field is in memory is checked against the layout, so that a library of another layout is refused.
    """

    def __init__(self, library: pathlib.Path | ctypes.PyDLL, layout: Layout) -> None:
        # Not CDLL: releasing the interpreter lock costs more than it can give a call of a few microseconds
        loaded = library if isinstance(library, ctypes.PyDLL) else load_library(library)
        loaded.wbc_tick_size.restype = loaded.wbc_tick_offset.restype = ctypes.c_longlong
        size = int(loaded.wbc_tick_size())
        raw = np.zeros(size // 8 + 8)
        shift = (-raw.ctypes.data % 64) // 8
        memory = raw[shift : shift + size // 8]
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

    def twin(self) -> NativeTick:
        return NativeTick(self._library, self._layout)
