"""What all ticks of a controller share: names, and where everything stands in a report."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout
from wbc.stack.memory import Memory
from wbc.tick.native import CompiledTick
from wbc.validation import Array, Entries

_Part = Callable[[bytes], Array]


def _part(first: int, count: int) -> _Part:
    """As :meth:`CompiledTick.part`."""
    return partial(np.frombuffer, dtype=np.float64, count=count, offset=8 * first)


class Context:
    """What all steps of a controller share: names and offsets."""

    def __init__(self, stack: Declaration, layout: Layout, assembly: CompiledTick | None) -> None:
        self.stack, self.layout, self.assembly = stack, layout, assembly
        self.nv, self.command = layout.nv, layout.command
        self.memory = Memory(layout)
        self.flag_offset = 8 * self.memory.flag
        #: bytes of a step without q (+) v dt, which a batch leaves out
        self.size = 8 * self.memory.state
        #: Step.v of a step's data, and Step.q_next where that is in it
        self.v_of, self.q_next_of = self._parts(_part if assembly is None else assembly.part)

    def _parts(self, part: Callable[[int, int], _Part]) -> tuple[_Part, _Part]:
        v = self.memory["v" if self.command == "velocity" else "next_v"].start
        return part(v, self.nv), part(self.memory.state, self.layout.nq)

    def __getstate__(self) -> dict[str, Any]:
        # the memory of a process; a step from a pickle tells everything but its explanation
        v_of, q_next_of = self._parts(_part)
        return vars(self) | {"assembly": None, "v_of": v_of, "q_next_of": q_next_of}

    def variable(self, number: int) -> str:
        """Name of a variable of the QP."""
        return self.stack.robot.dof_names[number] if number < self.nv else self.layout.variable(number)[0]

    def loop_forces(self, variables: Array) -> dict[str, Array]:
        """Of each loop by its name, of variables of a QP [..., variables]."""
        loops = self.stack.robot.loops
        ends = np.cumsum([self.layout.loop_forces.start, *(len(basis) for basis in loops.bases)]).tolist()
        parts = (variables[..., first:end] for first, end in itertools.pairwise(ends))
        triples = zip(loops.loops, loops.bases, parts, strict=True)
        return Entries("loop_forces", {loop.name: part @ basis for loop, basis, part in triples})

    @cached_property
    def general(self) -> list[tuple[Block, int]]:
        """(block, row within it) of every general row."""
        return [(b, k) for b in self.layout.of_form("margins", "rows") for k in range(len(b.rows))]

    @cached_property
    def bounds(self) -> list[Block]:
        """Bound blocks by number."""
        return self.layout.of_form("bounds")
