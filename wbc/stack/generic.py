"""The hand-written C of a tick for stacks of any size: compiled once, for rows that CasADi's virtual machine computes.

``native/*.h`` is written for sizes that are known when it is compiled: an array of ``NV`` numbers stands in a
structure, a table is a constant. Here the same text is made to take them when it runs: a size is a number of a
context, a table a pointer of it, and an array a pointer into memory that ``bind_tick`` lays out. So nothing is written
twice, and a tick gives the same answer both ways.

Rows are evaluated by :class:`casadi.FunctionBuffer`, whose address the context has. Where it has that of a tick that
was compiled for the stack (:mod:`wbc.stack.behind`), every function here calls the one of the same name there, which
works on the same fields of :class:`wbc.stack.memory.Memory`: so a tick changes over at once and as a whole.
"""

from __future__ import annotations

import os
import pathlib
import re
from collections.abc import Callable
from dataclasses import field

from wbc.native import kernel, toolchain
from wbc.native.library import file_bytes
from wbc.native.targets import TargetMachine
from wbc.quick_dataclasses import dataclass
from wbc.stack.commands import COMMANDS
from wbc.stack.memory import (
    INPUTS,
    LEVEL_NUMBERS,
    QP_FIELDS,
    REST_INPUTS,
    Field,
    reported,
)

#: Whole sizes of ``stack.h``, and real ones
SIZES = (
    "NQ", "NV", "NP", "MT", "MC", "NB", "MH", "NNZJ", "NNZA", "NNZK", "CALM", "BENDING", "ELASTIC", "UNITS",
    "LAST_ORDER", "ACTIVE_MAX", "DOFS", "SOFT_ROWS", "PRICES", "KEPT", "SLEWED", "LEADING", "LEVELS", "LEVEL_MOST",
    "SOFT_MAX", "BALLS", "SEGMENTS", "SENSED", "BLOCKED", "REDUCED", "REDUCED_NV", "SPARED", "CLOSING",
    "CLOSING_FIRST", "FORCES", "FORCED_NV", "FORCE_FIRST",
)  # fmt: skip
REALS = ("LONGEST", "LEFT_FREE", "DAMPING", "FAR")
#: Tables of ``stack.h``; the last four are what its BLOCKS are made of
INT_TABLES = (
    "j_start", "j_col", "a_start", "a_end", "a_col", "give_order", "late_row", "spare_first",
    "spare_row", "spare_held", "row_order", "bound_sequence",
    "unit_start", "unit_size", "row_torque",
    "k_row", "k_col", "bent", "margin_at", "rate_at", "gain_at", "brake_at", "stop_at", "stop_row", "stop_q", "kept_of",
    "price_at", "slewed_at", "slewed_dof", "level_start", "row_level", "ball_pose", "ball_velocity", "ball_margin",
    "ball_rate", "ball_row", "ball_first", "row_segment", "segment_row", "sensed_row", "sensed_count",
    "sensed_distance", "sensed_line", "sensed_side", "block_row", "block_rows", "block_first", "block_columns",
)  # fmt: skip
REAL_TABLES = (
    "force_scale", "brake_limit", "stop_low", "stop_high", "row_scale", "dof_scale", "damping", "slack_reported",
    "task_scale", "row_reach", "segment_half",
)  # fmt: skip
#: CasADi functions; what C gives them elsewhere than where they read it, and how much of it
FUNCTIONS = ("rows", "ahead", "curvature", "torque", "lost", "arrival")
COPIED = {"ahead": [(1, "mean", "DOFS")], "curvature": [(4, "force", "(MT + MC)")], "lost": [(1, "moved", "DOFS")]}
COPIED["arrival"] = [(0, "start", "NQ"), (1, "way", "DOFS")]
#: Arrays that only C knows and the functions write
WRITTEN = (
    "jt",
    "at",
    "bound_low",
    "bound_high",
    "curvature_entries",
    "segment",
    "screw",
    "segment_ahead",
    "opened",
    "closing_columns",
)
#: What the tick compiled for the stack does in place of what is here, once there is one
FORWARDED = (
    "wbc_tick_arrive", "wbc_tick_assemble", "wbc_tick_certify", "wbc_tick_check", "wbc_tick_curvature",
    "wbc_tick_ease", "wbc_tick_find_lost", "wbc_tick_hurries", "wbc_tick_look_ahead", "wbc_tick_missed",
    "wbc_tick_reset", "wbc_tick_resume", "wbc_tick_safe_step", "wbc_tick_solve", "wbc_tick_step", "wbc_tick_suspend",
    "wbc_tick_take", "wbc_tick_task_rows", "wbc_tick_torques",
)  # fmt: skip
#: What is either there or not when C is compiled
_CHOICES = ("LEVELS", "SOFT_ROWS", "SLEWED")
_ALWAYS = ("MH", "KEPT", "BENDING", "CLOSING", "NNZK", "BALLS", "SENSED")

#: What makes the sources of the files in ``native``
MAKERS = ("generic.py", "memory.py", "commands.py")

_EXPORTED = re.compile(r"^EXPORT ([\w ]+ )(\w+)\((?:const )?wbc_tick \*t([^)]*)\) \{", re.MULTILINE)
_MEMBERS = re.compile(r"^    (double|int|long long|wide) (.*?);", re.MULTILINE)
_ARRAY = re.compile(r"(\w+)\[(.*)\]")


@dataclass(frozen=True)
class Variant:
    """Stacks of one kind of code."""

    command: str
    levels: bool
    soft: bool

    def fields(self) -> tuple[tuple[Field, ...], tuple[Field, ...]]:
        """The report, and what follows it, of :class:`wbc.stack.memory.Memory`."""
        return reported(self.command, self.levels), (*INPUTS, *REST_INPUTS * (self.command != "velocity"), *QP_FIELDS)


@dataclass
class _Structure:
    """A structure whose arrays are pointers: its text, the statements that lay it out, and the size of each array."""

    text: str = ""
    layout: list[str] = field(default_factory=list)
    sizes: dict[str, str] = field(default_factory=dict)

    def add(self, kind: str, name: str, count: str) -> None:
        self.layout.append(f"CARVE(s->{name}, {kind}, {count})")
        self.sizes[name] = f"((size_t)({count}) * sizeof({kind}))"

    @staticmethod
    def of(body: str) -> _Structure:
        out = _Structure()
        lines = []
        for line in body.splitlines():
            if line.startswith("#"):
                out.layout.append(line)
            found = _MEMBERS.match(line)
            if found is None:
                lines.append(line)
                continue
            names = []
            for declared in found[2].split(", "):
                array = _ARRAY.fullmatch(declared)
                names.append(f"*{array[1]}" if array else declared)
                if array:
                    out.add(found[1], array[1], array[2])
            lines.append(f"    {found[1]} {', '.join(names)};")
        out.text = "\n".join(lines)
        return out


def variants() -> list[Variant]:
    """All kinds of code."""
    kinds = ((False, False), (False, True), (True, False))
    return [Variant(command, levels, soft) for command in COMMANDS for levels, soft in kinds]


def library(variant: Variant) -> pathlib.Path:
    """The library of a variant.

    Raises:
        CompileError: it was not compiled ahead, and there is no compiler, or it fails.
    """
    return kernel.library(origins(variant), compiling(variant), "the tick, once for all stacks", at_once=True)


def compiling(variant: Variant, target: TargetMachine | None = None) -> Callable[[kernel.Texts, pathlib.Path], None]:
    """What compiles a variant: (its origins, output)."""
    return lambda _, output: toolchain.compile_generic(sources(variant), output, target)


def origins(variant: Variant) -> dict[str, str]:
    """Name -> text of what :func:`sources` is made of: quicker to read than to make, and it changes when that does."""
    here = os.path.dirname(__file__)
    native = os.path.join(here, "native")
    files = [*((name, native) for name in sorted(os.listdir(native))), *((name, here) for name in MAKERS)]
    texts = {name: file_bytes(os.path.join(folder, name)).decode() for name, folder in files}
    return {"variant": repr(variant)} | texts


def sources(variant: Variant) -> dict[str, str]:
    """File name -> text; ``generic.c`` is what is compiled."""
    native = pathlib.Path(__file__).parent / "native"
    left_out = ("converge.h", "converge.c", "many.h", "library.c")
    found = [f for f in native.iterdir() if f.name.endswith((".c", ".h")) and f.name not in left_out]
    texts = {file.name: file.read_text() for file in found}
    report, rest = variant.fields()
    given, reported = _Structure(), _Structure()
    for to, fields, prefix in ((reported, report, "report."), (given, rest, "")):
        for each in fields:
            count = each.declaration().split("[", 1)[1].rstrip("];") if "[" in each.declaration() else "1"
            to.add("double", each.c_name, count)
        to.layout = [line.replace("s->", f"s->{prefix}") for line in to.layout]
    texts["tick.h"], tick, levels = _tick_structures(texts["tick.h"], variant)
    body = re.search(r"typedef struct \{\n(.*?)\n\} wbc_primal;", texts["primal.h"], re.DOTALL)
    assert body is not None
    primal = _Structure.of(body[1])
    texts["primal.h"] = texts["primal.h"].replace(body[0], _structure("wbc_primal", primal))
    texts["primal.h"] = texts["primal.h"].replace("memset(&s, 0, sizeof s);", "PRIMAL_ROOM(s)")
    tick.layout = [*reported.layout, *given.layout, "from = at = rest;", *tick.layout]
    scalars = [each.c_name for each in (*report, *rest) if not each.shape]
    own = {
        "out->": reported.sizes,
        "t->report.": reported.sizes,
        "t->levels.": levels.sizes,
        "t->": given.sizes | tick.sizes,
    }
    for name, text in texts.items():
        sizes = own | {"s->": primal.sizes if name == "primal.h" else levels.sizes}
        texts[name] = _at_run_time(text, scalars, sizes)
    texts["tick.h"] = texts["tick.h"].rstrip().removesuffix("#endif") + _layouts(tick, levels, variant) + "#endif\n"
    texts["tick.c"] = texts["tick.c"].replace(
        "memset(t, 0, sizeof *t);",
        "const wbc_context *given = t->context;\n    memset(t, 0, sizeof *t);\n    t->context = given;\n"
        "    bind_tick(t, (char *)given->memory, (char *)given->rest);",
    )
    names = [each.c_name for each in report], [each.c_name for each in rest]
    texts["memory.h"] = _memory(*names)
    texts["stack.h"] = _context(variant)
    texts["generic.c"] = _MAIN
    return texts


def _tick_structures(text: str, variant: Variant) -> tuple[str, _Structure, _Structure]:
    """``tick.h`` with pointers."""
    bodies = re.search(
        r"typedef struct \{\n(.*?)\n\} wbc_levels;.*typedef struct \{\n(.*?)\n\} wbc_tick;", text, re.DOTALL
    )
    assert bodies is not None
    levels, tick = _Structure.of(bodies[1]), _Structure.of(bodies[2])
    tick.text = tick.text.replace("    WBC_BUFFERS", "    const wbc_context *context;\n    WBC_BUFFERS", 1)
    text = text.replace(bodies[1], levels.text, 1).replace(bodies[2], tick.text, 1)
    return text, tick, levels


def _structure(name: str, made: _Structure) -> str:
    lines = "\n    ".join(made.layout)
    return (
        f"typedef struct {{\n{made.text}\n}} {name};\n\nstatic size_t bind_primal({name} *s, char *at) {{\n"
        f"    char *from = at;\n    {lines}\n    return at - from;\n}}\n"
    )


def _layouts(tick: _Structure, levels: _Structure, variant: Variant) -> str:
    """Functions that lay the arrays of a tick out and say how many bytes they take."""
    inner = "    at += bind_levels(&s->levels, at);\n" if variant.levels else ""
    parts = [("wbc_levels", "bind_levels", levels, "")] if variant.levels else []
    out = []
    for kind, name, made, last in (*parts, ("wbc_tick", "bind_tick", tick, inner)):
        lines = _conditions("\n    ".join(made.layout))
        more = ", char *rest" if kind == "wbc_tick" else ""
        out.append(f"static size_t {name}({kind} *s, char *at{more}) {{\n    char *from = at;\n    {lines}\n{last}")
        out.append("    return at - from;\n}\n")
    return "\n".join(["", *out])


def _conditions(text: str) -> str:
    """Conditions on sizes that are known only when the code runs."""
    known = "|".join((*_CHOICES, *_ALWAYS))
    return re.sub(
        r"^\s*#if.*$", lambda line: re.sub(rf"\b({known})\b", r"HAS_\1", line[0].strip()), text, flags=re.MULTILINE
    )


def _at_run_time(text: str, scalars: list[str], sizes: dict[str, dict[str, str]]) -> str:
    """Text of a file whose arrays are pointers and whose sizes are numbers."""
    text = _conditions(text)

    def size(found: re.Match[str]) -> str:
        return sizes[found[1]].get(found[2], found[0])

    text = re.sub(r"sizeof (out->|s->|t->report\.|t->levels\.|t->)(\w+)", size, text)
    text = re.sub(rf"\b((?:t|out)->(?:report\.)?)({'|'.join(scalars)})\b(?!\.)", r"(*\1\2)", text)
    # An array whose size is no constant cannot be given zeros where it is declared
    lines = []
    for line in text.splitlines():
        zeroed = re.findall(r"(\w+)\[([^][]*[A-Z][^][]*)\] = \{0\}", line)
        if zeroed:
            line = re.sub(r"(\w+\[[^][]*[A-Z][^][]*\]) = \{0\}", r"\1", line)
            line += "".join(f" memset({name}, 0, sizeof {name});" for name, _ in zeroed)
        lines.append(line)
    text = "\n".join(lines) + "\n"
    return _EXPORTED.sub(_forwarding, text)


def _forwarding(found: re.Match[str]) -> str:
    """The beginning of a function that the tick compiled for the stack does, once there is one."""
    kind, name, given = found[1].strip(), found[2], [each.strip() for each in found[3].split(",") if each.strip()]
    if name not in FORWARDED:
        return found[0] + " use(t->context);"
    types = ", ".join(["void *", *(re.sub(r"\w+$", "", each) for each in given)])
    call = f"(({kind} (*)({types}))t->context->{name}_)"
    call += f"({', '.join(['t->context->own', *(each.split()[-1].lstrip('*') for each in given)])});"
    done = f"{{ {call} return; }}" if kind == "void" else f"return {call}"
    return f"{found[0]}\n    if (t->context->own) {done}\n    use(t->context);"


def _memory(report: list[str], rest: list[str]) -> str:
    """``memory.h`` with pointers."""
    return "\n".join(
        [
            "#ifndef WBC_MEMORY_H",
            "#define WBC_MEMORY_H",
            f"typedef struct {{ double {', '.join(f'*{name}' for name in report)}; }} wbc_report;",
            f"#define WBC_BUFFERS wbc_report report; double {', '.join(f'*{name}' for name in rest)};",
            f"#define WBC_REPORT_FIELDS(X) {' '.join(f'X({name})' for name in report)}",
            f"#define WBC_BUFFER_FIELDS(X) {' '.join(f'X({name})' for name in rest)}",
            "#endif",
            "",
        ]
    )


def _context(variant: Variant) -> str:
    """``stack.h``: sizes and tables of the stack whose tick runs."""
    there = (variant.levels, variant.soft, variant.command != "velocity")
    chosen = dict(zip(_CHOICES, there, strict=True))
    tables = [(name, "int") for name in INT_TABLES] + [(name, "double") for name in REAL_TABLES]
    copies = [name for given in COPIED.values() for _, name, _ in given]
    names = [*SIZES, *REALS, *(name for name, _ in tables)]
    lines = [
        "#ifndef WBC_STACK_H",
        "#define WBC_STACK_H",
        "#include <stddef.h>",
        "#include <string.h>",
        f"#define COMMAND {COMMANDS.index(variant.command)}",
        f"#define LEVEL_NUMBERS {len(LEVEL_NUMBERS)}",
        *(f"#define {name} 0" for name in ("HANDED", "HANDED_TO_LOST", "HANDED_TO_TORQUE", "WORK_W", "WORK_IW")),
        *(f"#define HAS_{name} {int(there)}" for name, there in chosen.items()),
        *(f"#define HAS_{name} 1" for name in _ALWAYS),
        "/* Of eight bytes each, in the order that Python writes them in */",
        "typedef struct {",
        "    long long serial;",
        *(f"    long long {name}_;" for name in SIZES),
        *(f"    double {name}_;" for name in REALS),
        *(f"    const {kind} *{name}_;" for name, kind in tables),
        "    void (*evaluate)(void *);",
        *(f"    void *{name}_;" for name in FUNCTIONS),
        *(f"    double *{name}_;" for name in copies),
        "    double *memory, *rest;",
        "    void *own;",
        *(f"    void *{name}_;" for name in FORWARDED),
        "} wbc_context;",
        "static wbc_context S;",
        "static inline void use(const wbc_context *c) { if (c->serial != S.serial) S = *c; }",
        *(f"#define {name} {f'((int)S.{name}_)' if name in SIZES else f'(S.{name}_)'}" for name in names),
        _BLOCKS,
        "#define CARVE(p, kind, count) (p) = (void *)at; at += ((size_t)(count) * sizeof(kind) + 7) / 8 * 8;",
        "#endif",
        "",
    ]
    return "\n".join(lines)


_BLOCKS = """
#define BLOCKS(many, single) for (int n = 0; n < BLOCKED; n++) \\
    if (block_columns[n] == 1) single(t, block_row[n], block_rows[n], block_first[n]); \\
    else many(t, block_row[n], block_rows[n], block_first[n], block_columns[n]);
#define DIAGONALS for (int n = 0; n < BLOCKED; n++) \\
    for (int r = 0; block_columns[n] == 1 && r < block_rows[n]; r++) { \\
        const int e = block_first[n] + r, k = block_row[n] + r; \\
        t->y[j_col[e]] += t->weight[k] * t->report.factor[k] * t->jt[e] * t->jt[e]; \\
    }
#define PRIMAL_ROOM(s) \\
    memset(&s, 0, sizeof s); \\
    const size_t room = bind_primal(&s, NULL); \\
    bind_primal(&s, memset(__builtin_alloca(room), 0, room));
"""

_MAIN = (
    """/* A tick of any stack whose rows CasADi computes */
#include "tick.c"
#include "follow.h"
#include "carried.h"

#define EVALUATED(name) \\
    int name(const double **arg, double **res, long long *iw, double *w, int mem) { \\
        (void)arg, (void)res, (void)iw, (void)w, (void)mem;
"""
    + "".join(
        f"EVALUATED({name})\n    if (!S.{name}_) return 0;\n"
        + "".join(f"    memcpy(S.{to}_, arg[{k}], {n} * 8);\n" for k, to, n in COPIED.get(name, ()))
        + f"    S.evaluate(S.{name}_);\n    return 0;\n}}\n"
        for name in FUNCTIONS
    )
    + """
/* Bytes of the arrays of a tick in this context that are not in memory.h */
EXPORT long long wbc_generic_room(const wbc_context *context) {
    wbc_tick t;
    use(context);
    return (long long)bind_tick(&t, NULL, NULL);
}

EXPORT void wbc_generic_context(wbc_tick *t, const wbc_context *context) { t->context = context; }

/* Arrays that the functions write */
EXPORT const double *wbc_generic_written(const wbc_tick *t, int k) {
    const double *written[] = {"""
    + ", ".join(f"t->{name}" for name in WRITTEN)
    + """};
    return written[k];
}
"""
)
