"""One table of a tick's memory, which makes C's structures, numpy's views of them, and the header of an export.

All numbers here are doubles. First comes the report, then what the caller writes: a step copies both in one piece. Then
comes what solvers in Python read of the QP, and behind it what only C knows (``native/tick.h``). A library says where
each field is in its memory, and :class:`wbc.tick.native.NativeTick` refuses one that differs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from wbc.errors import CompileError
from wbc.quick_dataclasses import dataclass

if TYPE_CHECKING:
    from wbc.stack.layout import Layout
    from wbc.validation import Array

#: What is reported of each level, and of the least velocity after them
LEVEL_NUMBERS = (
    "rank",
    "free",
    "singular",
    "damping",
    "disturbance",
    "stationarity",
    "complementarity",
    "error",
    "solved",
)


@dataclass(frozen=True)
class Field:
    """An array of a tick's memory, or a single number.

    Attributes:
        name, c: its name in Python and in C, where that differs.
        shape: its sizes as sums of products of the macros of ``stack.h``; none for a single number.
        text: what it is.
        spare: C has one number more, so that no array is empty.
    """

    name: str
    shape: tuple[str, ...]
    text: str
    spare: bool = False
    c: str = ""

    @property
    def c_name(self) -> str:
        """Its name in C."""
        return self.c or self.name

    def declaration(self, flat: bool = True, macro: Callable[[str], str] = str) -> str:
        """In C; ``flat``: with one size. ``macro``: the spelling of a size."""
        shape = [macro(size) for size in self.shape]
        if flat and len(shape) > 1:
            shape = [" * ".join(f"({size})" if " " in size else size for size in shape)]
        if self.spare:
            shape[-1] += " + 1"
        return f"double {self.c_name}{''.join(f'[{size}]' for size in shape)};"


REPORT = (
    Field("v", ("NV",), "the command [rad/s, m/s], then the other variables of the QP"),
    Field("flag", (), "how the tick ended"),
    Field("iterations", (), "of the QP solver, all solves of the tick together"),
    Field("stationarity", (), "largest entry of |H v + g + A' lambda|"),
    Field("violation", (), "largest violation of a row or bound that was not relaxed, in its unit / s"),
    Field("complementarity", (), "largest |lambda (A v - b)|"),
    Field("error_bound", (), "bound on the largest |v - v*|; 1e30: not known"),
    Field("error", ("MT",), "error of every task row before the step, in its unit", True),
    Field("factor", ("MT",), "1, or less where a task row fades near a singularity", True),
    Field("margin", ("MH",), "margins before the step, in their units, >= 0 where they hold", True),
    Field("margin_factor", ("MH",), "1, or less where a margin row fades", True),
    Field("ahead", ("MH",), "margins after v has been held for dt", True),
    Field("multipliers", ("NV + MC",), "of the bounds, then of the rows; > 0 at the upper bound", True, "lambda"),
    Field("slack", ("MC",), "by how much a row is missed, in its unit / s", True),
    Field("lost", ("MC",), "what equality rows lose until v has been held for dt: their residual bends", True),
    Field("owner_low", ("NV",), "number of the bound that sets each lower bound of v, -1: none"),
    Field("owner_high", ("NV",), "the same for the upper bound"),
    Field("beyond", ("NV",), "by how much bounds of v gave way to closed loops"),
)
#: Of strict levels
LEVEL_REPORT = (
    Field("missed", ("MT",), "rate of every task row less the rate that it asks for", True),
    Field("share", ("MT",), "part of every task row that the levels before left free, 0 to 1", True),
    Field("dropped", ("MC",), "of equality rows that depend on others, how far they are off; else -1", True),
    Field("pushes", ("NV + MC",), "index of the level that a row pushes against first, -1: none", True),
    Field("levels", ("LEVELS + 1", "LEVEL_NUMBERS"), f"{', '.join(LEVEL_NUMBERS)}; last the least velocity"),
)
#: Of accelerations and torques
REST_REPORT = (
    Field("next_v", ("DOFS",), "velocity at the end of the tick; of a robot with loops one that keeps them closed"),
    Field("next_q", ("NQ",), "configuration there, of a robot with loops", True),
)
#: Of torques
TORQUE_REPORT = (Field("torque", ("DOFS",), "torques of the joints [N m, N]"),)
INPUTS = (
    Field("q", ("NQ",), "configuration", True),
    Field("v_last", ("NV",), "velocity that accelerations are counted from"),
    Field("p", ("NP",), "run-time inputs", True),
    Field("dt", (), "time to the next command [s]"),
    Field("v_in", ("NV",), "a measured velocity, taken in place of the last command where use_v is not 0"),
    Field("use_v", (), ""),
    Field("cap", (), "iterations of the QP solver a tick at most; 0: as many as it takes"),
    Field("weight", ("MT",), "of each task row, scale included", True),
    Field("enabled", ("MC",), "1 or 0 for each general row", True),
    Field("bound_enabled", ("NB * NV",), "the same for each entry of each bound block", True),
    Field("bend", ("MC",), "added to both sides of equality rows, for what they lose; a tick begins with 0", True),
    Field("curving", (), "not 0: H has the curvature of equality rows, whatever CALM says; a tick begins with 0"),
    Field("shortened", (), "on the diagonal of H besides, in units of dof_scale; a tick begins with 0"),
    Field("stopped", ("NV",), "1 for joints that bounds stop and that others do not count on; a tick begins with 0"),
    Field("shortfall", ("MT",), "of errors, by bounds on velocities: see reach.h; a tick begins with 0", True),
    Field("pressed", ("MC",), "force of margins on the command times dt: see reach.h; a tick begins with 0", True),
    Field("plain", (), "not 0: the linear model as it is, whatever CALM says"),
)
#: Of accelerations
REST_INPUTS = (
    Field("kept", ("NV",), "torques of the last command, 1e30: unknown; wrenches of the last tick with an answer"),
)
QP_FIELDS = (
    Field("H", ("NV", "WIDE"), "upper triangle, row by row"),
    Field("g", ("WIDE",), ""),
    Field("A", ("MC * NV",), "general rows", True),
    Field("low", ("NV + MC",), "bounds of the variables, then of the general rows"),
    Field("high", ("NV + MC",), ""),
    Field("unusable", (), "not 0: numbers that are not finite, or bounds without an interval"),
    Field("desired", ("MT",), "rate that each task row asks for", True),
    Field("free_low", ("MC",), "bounds of the general rows before relaxation", True),
    Field("free_high", ("MC",), "", True),
    Field("give", ("MC",), "by how much a soft row gives way per multiplier; 0 for hard rows", True),
)


def sizes(layout: Layout) -> dict[str, int]:
    """Macros that the shapes of fields are made of."""
    return {
        "NQ": layout.nq,
        "NV": layout.variables,
        "DOFS": layout.nv,
        "NP": layout.parameters,
        "MT": layout.task_rows,
        "MC": layout.general_rows,
        "NB": layout.bound_blocks,
        "MH": layout.margin_rows,
        "WIDE": (layout.variables + 7) // 8 * 8,
        "LEVELS": len(layout.levels) if layout.cascade else 0,
        "LEVEL_NUMBERS": len(LEVEL_NUMBERS),
    }


def report_fields(layout: Layout) -> tuple[Field, ...]:
    """What a tick reports."""
    return reported(layout.command, layout.cascade)


def reported(command: str, levels: bool) -> tuple[Field, ...]:
    """What a tick with such a command reports, and whether it has strict levels."""
    rest, torque = REST_REPORT * (command != "velocity"), TORQUE_REPORT * (command == "torque")
    return REPORT + LEVEL_REPORT * levels + rest + torque


def input_fields(layout: Layout) -> tuple[Field, ...]:
    """What the caller writes."""
    return INPUTS + (REST_INPUTS if layout.command != "velocity" else ())


class Memory:
    """Where each field of a layout is in a tick's memory.

    Attributes:
        fields: in the order of memory. report: numbers of the report. state: of it and what the caller writes.
        size: of all fields.
    """

    def __init__(self, layout: Layout) -> None:
        known, reported = sizes(layout), report_fields(layout)
        given = input_fields(layout)
        self.fields = (*reported, *given, *QP_FIELDS)
        self._slices: dict[str, slice] = {}
        self._shapes: dict[str, tuple[int, ...]] = {}
        ends = {}
        start = 0
        for field in self.fields:
            shape = tuple(_value(size, known) for size in field.shape)
            self._shapes[field.name] = shape or (1,)
            self._slices[field.name] = slice(start, start + math.prod(shape))
            start = ends[field.name] = start + math.prod(shape) + field.spare
        self.report, self.state, self.size = ends[reported[-1].name], ends[given[-1].name], start
        #: place of the flag
        self.flag = int(self._slices["flag"].start)

    def __getitem__(self, name: str) -> slice:
        """Places of a field's numbers, the spare one left out."""
        return self._slices[name]

    def view(self, memory: Array, name: str) -> Array:
        """A field within memory that begins with the report, in its shape."""
        view: Array = memory[self._slices[name]].reshape(self._shapes[name])
        return view

    def require(self, offset: Callable[[int], int], library: str) -> None:
        """The fields of a library are where this layout has them.

        Args:
            offset: bytes before the field of a number in C; -1 behind the last one.

        Raises:
            CompileError: one is elsewhere; the message names it.
        """
        for number, field in enumerate(self.fields):
            here, there = 8 * self._slices[field.name].start, offset(number)
            if here != there:
                reason = f"was built for another layout: {field.c_name} is at byte {there} in place of {here}"
                raise CompileError("library", library, reason)
        if offset(len(self.fields)) != -1:
            raise CompileError("library", library, "was built for another layout: it has more fields")


def structures(layout: Layout) -> str:
    """``memory.h``: the report's structure, and the fields that the tick begins with."""
    reported, given = report_fields(layout), input_fields(layout)
    lines = ["/* Memory of a tick that its caller knows, from the table in memory.py; generated */"]
    lines += [
        "#ifndef WBC_MEMORY_H",
        "#define WBC_MEMORY_H",
        "",
        "typedef struct {",
        *_members(reported),
        "} wbc_report;",
        "",
    ]
    buffers = ["    wbc_report report;", *_members((*given, *QP_FIELDS))]
    lines += ["/* The first fields of wbc_tick */", "#define WBC_BUFFERS \\", " \\\n".join(buffers), ""]
    lines += ["/* X(field) for each, in the order of memory */"]
    lines += [f"#define WBC_REPORT_FIELDS(X) {' '.join(f'X({field.c_name})' for field in reported)}"]
    lines += [f"#define WBC_BUFFER_FIELDS(X) {' '.join(f'X({f.c_name})' for f in (*given, *QP_FIELDS))}"]
    return "\n".join([*lines, "", "#endif", ""])


def _members(fields: tuple[Field, ...]) -> Iterator[str]:
    for field in fields:
        yield f"    {field.declaration()}{f' /* {field.text} */' if field.text else ''}"


def _value(size: str, known: dict[str, int]) -> int:
    """A sum of products of macros and numbers."""
    return sum(
        math.prod(known[word] if word in known else int(word) for word in term.split(" * "))
        for term in size.split(" + ")
    )
