"""The public header of an export: sizes, places by name with their units, and the functions."""

from __future__ import annotations

import re
from importlib import resources

from wbc.export.memory import bytes_of_tick
from wbc.export.snapshot import Snapshot, numbers
from wbc.stack.layout import Block, Slot
from wbc.stack.memory import report_fields, sizes

_KINDS = {
    "pose": "rotation matrix by columns (9), then position (3)",
    "rotation": "rotation matrix by columns",
    "configuration": "a configuration",
    "tangent": "a velocity of each degree of freedom",
    "vector": "",
}


def header(snapshot: Snapshot) -> str:
    """Text of ``wbc_tick.h``."""
    template = (resources.files("wbc.export") / "c" / "wbc_tick.in.h").read_text()
    parts = {
        "SIZES": _sizes(snapshot),
        "PLACES": _places(snapshot),
        "ROBOT": _robot(snapshot),
        "RESULT": _result(snapshot),
    }
    for name, text in parts.items():
        template = template.replace(f"@{name}@", text)
    return template


def _sizes(snapshot: Snapshot) -> str:
    layout, sources = snapshot.layout, snapshot.sources
    low, high = snapshot.stack.dt_range
    named = {
        "NQ": (layout.nq, "numbers of a configuration"),
        "NV": (layout.nv, "degrees of freedom: numbers of a velocity"),
        "VARIABLES": (
            layout.variables,
            "of the QP: the velocities, slacks of soft rows, and speeds of scaled tasks",
        ),
        "NP": (layout.parameters, "run-time inputs"),
        "TASK_ROWS": (layout.task_rows, "rows of tasks"),
        "ROWS": (layout.general_rows, "rows of constraints other than bounds on velocities"),
        "MARGINS": (layout.margin_rows, "rows of constraints that have a margin"),
        "BOUND_BLOCKS": (layout.bound_blocks, "constraints that are bounds on velocities"),
        "DT": (repr(snapshot.stack.dt), f"time between commands [s]; wbc_set_dt takes {low:g} to {high:g}"),
    }
    lines = [f"#define WBC_{name} {value} /* {text} */" for name, (value, text) in named.items()]
    single, double = (bytes_of_tick(sources["tick.h"], sources["stack.h"], layout, number) for number in (4, 8))
    memory = ["#ifdef WBC_SINGLE", f"# define WBC_BYTES {single}", "#else", f"#define WBC_BYTES {double}", "#endif"]
    return "\n".join([*lines, "/* memory of a controller, or a little more */", *memory])


#: Sizes in the public header
_MACROS = {
    "NV": "WBC_VARIABLES",
    "MT": "WBC_TASK_ROWS",
    "MC": "WBC_ROWS",
    "MH": "WBC_MARGINS",
    "DOFS": "WBC_NV",
    "NQ": "WBC_NQ",
}


def _result(snapshot: Snapshot) -> str:
    """Members of ``wbc_result``."""
    known = sizes(snapshot.layout)
    numbers = {name: str(known[name]) for name in ("LEVELS", "LEVEL_NUMBERS")}

    def macro(size: str) -> str:
        return re.sub(r"[A-Z_]{2,}", lambda word: (_MACROS | numbers)[word[0]], size)

    fields = report_fields(snapshot.layout)
    lines = [f"    {f.declaration(flat=False, macro=macro)} /* {f.text} */" for f in fields]
    return "\n".join(lines).replace("    double ", "    wbc_real ")


def _robot(snapshot: Snapshot) -> str:
    robot = snapshot.stack.robot
    lines = [f"/* {_comment(robot.name)}: degrees of freedom, as in every velocity"]
    for i, (name, unit) in enumerate(zip(robot.dof_names, robot.dof_units, strict=True)):
        place = int(robot.position_index[i])
        where = f"q[{place}]" if place >= 0 else "part of a rotation or a free base in q"
        lines.append(f" *   {i:3d}  {_comment(name)} [{unit}/s], {where}")
    values = ", ".join(numbers(snapshot.q))
    return "\n".join([*lines, " */", f"#define WBC_Q0 {{{values}}} /* configuration at the export */"])


def _places(snapshot: Snapshot) -> str:
    lines: list[str] = []
    used: set[str] = {"WBC_TASK_ROWS"}

    def define(name: str, value: int) -> str:
        return f"#define {_unique(name, used)} {value}"

    for block in snapshot.layout.blocks.values():
        name = re.sub(r"\W", "_", block.entry.name, flags=re.ASCII).upper()
        lines += ["", f"/* {_comment(block.entry.name)}: {type(block.entry.item).__name__}, {_rows_text(block)} */"]
        count = len(block.rows)
        if block.form == "task":
            lines += [define(f"WBC_TASK_{name}", block.start), define(f"WBC_TASK_{name}_ROWS", count)]
        elif block.form == "bounds":
            lines.append(define(f"WBC_BOUND_{name}", block.start * snapshot.layout.variables))
        else:
            lines += [define(f"WBC_ROW_{name}", block.start), define(f"WBC_ROW_{name}_ROWS", count)]
        if block.form == "margins":
            lines.append(define(f"WBC_MARGIN_{name}", block.margin_start))
        for slot in block.slots.values():
            lines += [f"/* {_slot_text(slot)} */", define(f"WBC_P_{name}_{slot.input.name.upper()}", slot.start)]
    return "\n".join(lines)


def _rows_text(block: Block) -> str:
    units = ", ".join(dict.fromkeys(row.unit or "1" for row in block.rows))
    labels = ", ".join(row.label for row in block.rows[:12])
    more = f", ... {len(block.rows) - 12} more" if len(block.rows) > 12 else ""
    return f"rows [{units}]: {_comment(labels)}{more}" if block.rows else "no rows"


def _slot_text(slot: Slot) -> str:
    """What an input is."""
    given = slot.input
    parts = [f"{given.name} [{given.unit or '1'}]", f"{slot.size} number{'s' if slot.size != 1 else ''}"]
    if _KINDS[given.kind]:
        parts.append(_KINDS[given.kind])
    if given.low > -float("inf") or given.high < float("inf"):
        parts.append(f"{given.low:g} to {given.high:g}")
    if given.direction:
        parts.append("of unit length")
    if given.rate:
        parts.append(f"its time derivative is {given.rate}")
    if given.sensed:
        parts.append("SENSED: the caller measures it before every step")
    return _comment(", ".join(parts))


def _unique(name: str, used: set[str]) -> str:
    """The name, with a number behind it where it is taken."""
    macro, count = name, 2
    while macro in used:
        macro, count = f"{name}_{count}", count + 1
    used.add(macro)
    return macro


def _comment(text: str) -> str:
    """Text that cannot end a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *")
