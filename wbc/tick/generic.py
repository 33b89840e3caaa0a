"""The tick whose hand-written part is compiled once for all stacks; CasADi's virtual machine computes its rows."""

from __future__ import annotations

import ctypes
import functools
import itertools
import os
from typing import Any

import casadi as ca
import numpy as np

from wbc.errors import CompileError
from wbc.native import toolchain
from wbc.native.library import load_library
from wbc.stack import generic
from wbc.stack.behind import NativeBehind
from wbc.stack.codegen import blocks, stack_numbers
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.stack.program import TickProgram
from wbc.tick.native import CompiledTick, aligned
from wbc.validation import Array

#: What the structure of the stack's own code may have besides, as it has no pointers and other gaps [numbers]
_SPARE = 512
#: A library that is loaded already; Windows never loads one of the same path again
_LOADED = getattr(os, "RTLD_NOLOAD", ctypes.DEFAULT_MODE)
#: No two contexts of a process have the same
_serials = itertools.count(1)
_capsule = ctypes.pythonapi.PyCapsule_GetPointer
_capsule.restype, _capsule.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
_capsule_name = ctypes.pythonapi.PyCapsule_GetName
_capsule_name.restype, _capsule_name.argtypes = ctypes.c_char_p, [ctypes.py_object]


@functools.cache
def _evaluate() -> int:
    """Address of what evaluates a buffer of CasADi."""
    # The one that is loaded: the wheel has the same library by several names, and another would be a second copy of it
    folder = os.path.dirname(ca.__file__)
    for name in sorted(name for name in os.listdir(folder) if name.startswith("libcasadi.")):
        try:
            found: Any = ctypes.PyDLL(os.path.join(folder, name), mode=_LOADED)._ZN6casadi21_function_buffer_evalEPv
        except (OSError, AttributeError):
            continue
        return ctypes.cast(found, ctypes.c_void_p).value or 0
    raise CompileError("casadi", toolchain.solver_version(), "its library has no function that evaluates a buffer")


@functools.cache
def _library(variant: generic.Variant) -> ctypes.PyDLL:
    library = load_library(generic.library(variant))
    library.wbc_generic_room.restype = library.wbc_tick_size.restype = ctypes.c_longlong
    library.wbc_generic_written.restype = ctypes.c_void_p
    return library


def _address(library: ctypes.PyDLL, name: str) -> int:
    """Of a function; 0 where there is none."""
    function: Any = getattr(library, name, None)
    return 0 if function is None else ctypes.cast(function, ctypes.c_void_p).value or 0


class GenericTick(CompiledTick):
    """Memory of one controller, and functions of the library that all stacks of its kind share.

    Raises:
        CompileError: there is no such library and no compiler that could make it.
    """

    def __init__(
        self, program: TickProgram, stack: Declaration, layout: Layout, behind: NativeBehind | None = None
    ) -> None:
        self._given = (program, stack, layout, behind)
        soft = not layout.cascade and any(at >= 0 for at in layout.price_at)
        variant = generic.Variant(layout.command, layout.cascade, soft)
        library = _library(variant)
        self._context = _ContextStruct(stack, layout, program)
        self._rest = np.zeros(int(library.wbc_generic_room(self._context.pointer)) // 8)
        self._tick = np.zeros(int(library.wbc_tick_size()) // 8 + 1)
        self._places = Memory(layout)
        # What only C knows is the same in the stack's own code, but for numbers that its functions work with
        worked = 3 * sum(function.n_instructions() for function in program.functions.values())
        more = len(self._rest) + len(self._tick) + worked + _SPARE
        self._room = self._places.size + (0 if behind is None else more)
        memory = aligned(self._room)
        self._context.set_together({"memory": memory.ctypes.data, "rest": self._rest.ctypes.data})
        pointer = ctypes.c_void_p(self._tick.ctypes.data)
        library.wbc_generic_context(pointer, self._context.pointer)
        super().__init__(library, layout, memory, pointer)
        self._bind(program, layout)
        self._offered: ctypes.PyDLL | None = None
        if behind is not None:
            behind.give(self)

    @property
    def tier(self) -> str:
        return "native" if self._context["own"] else "vm"

    def offer(self, library: ctypes.PyDLL) -> None:
        library.wbc_tick_size.restype = library.wbc_tick_offset.restype = ctypes.c_longlong
        self._places.require(library.wbc_tick_offset, library._name)
        if library.wbc_tick_size() > 8 * self._room:
            raise CompileError("library", library._name, "needs more memory than there is")
        self._offered = library
        self.wake()

    def change_over(self) -> None:
        # May be interrupted anywhere: the tick is here until its context says that it is there, and done twice this
        # leaves what done once does
        if (library := self._offered) is None:
            return
        carried = np.zeros(int(self._library.wbc_tick_carried()), np.intc)
        place, given = ctypes.c_void_p(self._memory.ctypes.data), ctypes.c_void_p(carried.ctypes.data)
        self._library.wbc_tick_suspend(self.pointer, given)
        library.wbc_tick_take_over(place, given)
        there = {name: _address(library, name) for name in generic.FORWARDED}
        self._context.set_together(there | {"own": self._memory.ctypes.data})
        self._offered = None

    @property
    def offered(self) -> bool:
        return self._offered is not None

    def twin(self) -> GenericTick:
        return GenericTick(*self._given)

    def _written(self, name: str, count: int) -> Array:
        """An array that only C has the name of."""
        address = int(self._library.wbc_generic_written(self.pointer, generic.WRITTEN.index(name)))
        start = (address - self._rest.ctypes.data) // 8
        return self._rest[start : start + max(1, count)]

    def _bind(self, program: TickProgram, layout: Layout) -> None:
        """Have the functions of the rows read and write the tick's memory."""
        places = self._places

        def field(name: str, least: int = 0) -> Array:
            place = places[name]
            return self._memory[place.start : max(place.stop, place.start + 1, place.start + least)]

        q, p, dt, v = field("q"), field("p"), field("dt"), field("v_last")
        sizes_of_copies = (
            ("mean", layout.nv),
            ("moved", layout.nv),
            ("start", layout.nq),
            ("way", layout.nv),
            ("force", layout.task_rows + layout.general_rows),
        )
        copies = {name: np.zeros(max(1, count)) for name, count in sizes_of_copies}
        for name, array in copies.items():
            self._context.set(name, array.ctypes.data)
        state = [q, v[: layout.nv], p, dt]
        named = {"low": "free_low", "high": "free_high"}
        written = [
            self._written(name, program.rows.nnz_out(k)) if name in generic.WRITTEN else field(named.get(name, name))
            for k, name in enumerate(program.rows.name_out())
        ]
        ahead = [self._written("segment_ahead", program.ahead.nnz_out(1))] if program.balls and program.ahead else []
        calls: dict[str, tuple[Any, list[Array], list[Array]]] = {
            "rows": (program.rows, state, written),
            "ahead": (program.ahead, [q, copies["mean"], p, dt], [field("ahead"), *ahead]),
            "lost": (program.lost, [q, copies["moved"], p, dt], [field("lost")]),
        }
        if program.curvature is not None:
            entries = self._written("curvature_entries", program.curvature.nnz_out(0))
            calls["curvature"] = program.curvature, [*state, copies["force"]], [entries]
        if program.arrival is not None:
            written = [field("next_q"), self._written("opened", program.arrival.nnz_out(1))]
            written.append(self._written("closing_columns", program.arrival.nnz_out(2)))
            calls["arrival"] = program.arrival, [copies["start"], copies["way"], p, dt], written
        if program.torque is not None:
            calls["torque"] = program.torque, [*state, field("v"), field("enabled")], [field("torque")]
        self._bound: list[Any] = [copies]
        for name, (function, arguments, results) in calls.items():
            if function is None:
                continue
            buffer, _ = function.buffer()
            for i, array in enumerate(arguments):
                buffer.set_arg(i, memoryview(array.data))
            for i, array in enumerate(results):
                buffer.set_res(i, memoryview(array.data))
            capsule = buffer._self()
            self._context.set(name, _capsule(capsule, _capsule_name(capsule)))
            self._bound += [buffer, function, arguments, results]


class _ContextStruct:
    """The sizes and tables of a stack as ``wbc_context`` has them: numbers and addresses of eight bytes each."""

    def __init__(self, stack: Declaration, layout: Layout, program: TickProgram) -> None:
        sizes, tables = stack_numbers(stack, layout, program)
        jt = program.rows.sparsity_out("jt")
        found = blocks(np.array(jt.colind()[: layout.leading + 1]), np.array(jt.row(), dtype=np.intp))
        blocked = np.array(found, np.intc).reshape(-1, 4)
        names = [
            "serial", *generic.SIZES, *generic.REALS, *generic.INT_TABLES, *generic.REAL_TABLES, "evaluate",
            *generic.FUNCTIONS, *(name for given in generic.COPIED.values() for _, name, _ in given), "memory", "rest",
            "own", *generic.FORWARDED,
        ]  # fmt: skip
        self._place = {name: k for k, name in enumerate(names)}
        self._entries = np.zeros(len(names), np.int64)
        self._kept: list[np.ndarray] = []
        for name in generic.SIZES:
            self.set(name, len(found) if name == "BLOCKED" else int(sizes.get(name, 0)))
        for name in generic.REALS:
            self._entries.view(np.float64)[self._place[name]] = sizes.get(name, 0.0)
        for k, name in enumerate(generic.INT_TABLES[-4:]):
            self._table(name, np.ascontiguousarray(blocked[:, k]))
        for name in generic.INT_TABLES[:-4]:
            self._table(name, np.array([*tables.get(name, ("int", ()))[1], 0], np.intc))
        for name in generic.REAL_TABLES:
            self._table(name, np.array([*tables.get(name, ("double", ()))[1], 0.0]))
        self.set("evaluate", _evaluate())
        self.pointer = ctypes.c_void_p(self._entries.ctypes.data)

    def __getitem__(self, name: str) -> int:
        return int(self._entries[self._place[name]])

    def set(self, name: str, value: int) -> None:
        """A whole number, or an address; with a new serial, by which C sees that something has changed."""
        self._entries[0] = next(_serials)
        self._entries[self._place[name]] = value

    def set_together(self, values: dict[str, int]) -> None:
        """Several at once: no tick sees but some of them, as one copy is made under the interpreter's lock."""
        entries = self._entries.copy()
        for name, value in values.items():
            entries[self._place[name]] = value
        entries[0] = next(_serials)
        self._entries[:] = entries

    def _table(self, name: str, values: np.ndarray) -> None:
        self._kept.append(values)
        self.set(name, values.ctypes.data)
