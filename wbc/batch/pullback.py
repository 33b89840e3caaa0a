"""From derivatives by the commands of many robots to those by what their ticks were given, all values in one pass."""

from __future__ import annotations

import ctypes
import pathlib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import casadi as ca
import numpy as np

from wbc import validation
from wbc.batch.derivatives import REGULAR, Derivatives
from wbc.errors import SolverError
from wbc.native.compiled_function import generated_library
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.stack.program import build
from wbc.tick.context import Context
from wbc.validation import Array

#: What gradients are taken by, in the order in which they come
PARTS = ("q", "v_last", "p", "weight")
#: What is solved in C, behind what CasADi generates
_SOURCE = pathlib.Path(__file__).with_name("native") / "pull.h"


def reason_against(context: Context) -> str:
    """Why the ticks of a stack are not all in its CasADi functions; "" where they are."""
    layout, stack = context.layout, context.stack
    if layout.command != "velocity":
        return f"it commands {layout.command}"
    if layout.cascade or any(at >= 0 for at in layout.price_at):
        return "it has strict levels or soft rows"
    return "it is calm: declare it with Stack(calm=False)" if stack.calm else ""


class Pullback:
    """The vector products w' dv/dx of ticks whose rows all hold: [y; mu] solves the equations of
    :class:`~wbc.batch.derivatives.Derivatives` with the right side [w; 0], and

        w' dv/dx = -y' (dH v + dg + dC_S' lam)/dx + mu' (db_S - dC_S v)/dx

    is the gradient of one number, which CasADi differentiates backwards.

    Raises:
        CompileError: there is no compiler, or it fails.
    """

    def __init__(self, derivatives: Derivatives, context: Context, threads: int) -> None:
        self._context, self._threads = context, threads
        self._each = [derivatives.twin() for _ in range(threads)]
        layout, memory = context.layout, context.memory
        n, m, b = layout.variables, layout.general_rows, layout.bound_blocks
        function = _gradient(layout, memory, [n, m, n, m, m, b * n, b * n], context)
        at = {name: memory[name].start for name in ("v", "owner_low", "owner_high")}
        at |= {name: memory[name].start - memory["H"].start for name in ("H", "A", "low", "high")}
        at["force"] = memory["multipliers"].start
        macros: dict[str, float] = {f"{name.upper()}_AT": place for name, place in at.items()}
        macros |= {"IW": max(1, function.sz_iw()), "W": max(1, function.sz_w()), "ARG": function.sz_arg()}
        macros |= {"RES": function.sz_res(), "INPUTS": function.size1_in(0), "GIVEN": function.size1_in(1)}
        macros |= {"N": n, "M": m, "BLOCKS": b, "H_WIDTH": _size(memory, "H") // n, "PROBLEM": derivatives.size}
        macros |= {"REPORT": memory.report, "OUT": function.size1_out(0), "REGULAR": REGULAR}
        self._width, self._ends = function.size1_out(0), np.cumsum([0, *(_size(memory, name) for name in PARTS)])
        head = "#include <math.h>\n#include <string.h>\n"
        tail = "".join(f"#define {name} {value}\n" for name, value in macros.items())
        tail += _SOURCE.read_text(encoding="utf-8")

        def text() -> str:
            generator = ca.CodeGenerator("pulled.c", {"with_header": False})
            generator.add(function)
            return f"{head}{generator.dump()}{tail}"

        library = generated_library(f"{function.serialize()}{tail}", text)
        self._pull = ctypes.CDLL(str(library)).pull_many
        self._pull.restype = ctypes.c_longlong

    def require(self, values: Iterable[tuple[str, str]]) -> None:
        """Items and their values are those of the stack.

        Raises:
            UnknownNameError: no such item or value.
        """
        blocks = self._context.layout.blocks
        for item, value in values:
            validation.one_of(f"{item}.{value}", value, blocks[validation.one_of("item", item, blocks)].slots)

    def find(self, weights: Array, reports: Array, inputs: Array) -> dict[str, Array]:
        """Part of :data:`PARTS` -> gradients [n, k] of sum(weights * v), by its numbers as they are.

        Args:
            weights: [n, nv]. reports, inputs: of n robots, whose ticks are over and whose rows all hold.
        """
        out = np.empty((len(inputs), self._width))
        pieces = np.array_split(np.arange(len(inputs)), self._threads)
        work = partial(self._piece, weights, reports, inputs, out)
        if len(inputs) < self._threads * 64:
            work(slice(None), 0)
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(work, (slice(piece[0], piece[-1] + 1) for piece in pieces), range(self._threads)))
        return {name: out[:, a:b] for name, a, b in zip(PARTS, self._ends, self._ends[1:], strict=False)}

    def _piece(self, weights: Array, reports: Array, inputs: Array, out: Array, where: slice, thread: int) -> None:
        memory = self._context.memory
        given, start = inputs[where].copy(), memory.report
        # Accelerations count from where the tick found them
        place = {name: slice(memory[name].start - start, memory[name].stop - start) for name in ("v_last", "v_in")}
        given[:, place["v_last"]] = given[:, place["v_in"]]
        problems = self._each[thread].assembled(given)
        arrays = [given, problems, *(np.ascontiguousarray(rows[where]) for rows in (reports, weights)), out[where]]
        places = (ctypes.c_void_p(array.ctypes.data) for array in arrays)
        if (done := self._pull(ctypes.c_longlong(len(given)), *places)) < len(given):
            raise SolverError("pull", int(done), "rows that hold leave the command of this robot open")


def _size(memory: Memory, name: str) -> int:
    return int(memory[name].stop - memory[name].start)


def _gradient(layout: Layout, memory: Memory, sizes: list[int], context: Context) -> ca.Function:
    """(inputs of a robot, what is held fixed) -> gradient by :data:`PARTS`."""
    stack, start = context.stack, memory.report
    program = build(stack, layout)
    x = ca.SX.sym("x", memory.state - start)
    q, v_last, p, weight, dt = (x[memory[name].start - start : memory[name].stop - start] for name in (*PARTS, "dt"))
    z = ca.SX.sym("z", sum(sizes))
    v, force, y, mu_low, mu_high, of_low, of_high = ca.vertsplit(z, np.cumsum([0, *sizes]).tolist())
    rows = program.rows(q=q, v=v_last, p=p, dt=dt)
    along_y, along_v = rows["jt"].T @ y, rows["jt"].T @ v
    damping = stack.damping / layout.dof_scales(stack) ** 2
    number = -ca.dot(y, damping * v) - ca.dot(weight * rows["factor"] * along_y, along_v - rows["desired"])
    number -= ca.dot(rows["at"].T @ y, force) + ca.dot(mu_low + mu_high, rows["at"].T @ v)
    number += ca.dot(mu_low, rows["low"]) + ca.dot(mu_high, rows["high"])
    number += ca.dot(of_low, ca.vec(rows["bound_low"])) + ca.dot(of_high, ca.vec(rows["bound_high"]))
    found = ca.gradient(number, x)
    picked = [found[memory[name].start - start : memory[name].stop - start] for name in PARTS]
    return ca.Function("pulled", [x, z], [ca.densify(ca.vertcat(*picked))])
