"""C source of one stack's tick: the generated rows, the tables, and the hand-written cycle in ``native/``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from wbc.shapes import FAR
from wbc.stack.commands import COMMANDS
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import LEVEL_NUMBERS, structures
from wbc.stack.program import TickProgram, sparsity_rows
from wbc.stack.sources import completed
from wbc.stack.tables import (
    bent_rows,
    brakes,
    force_scales,
    forces_in_loops,
    gain_table,
    give_order,
    kept_rows,
    late_rows,
    left_free,
    margin_table,
    rate_table,
    reported_slacks,
    spare_rows,
    stops,
    taken_out,
    torque_rows,
)
from wbc.symbolic.kinematics import Kinematics

#: Class of rows that have a price in the order of sacrifice: they give way at it, and before any other
PRICED = 99


def sources(stack: Declaration, layout: Layout, program: TickProgram, moves: bool = False) -> dict[str, str]:
    """File name -> text of everything that makes the tick of a stack; ``moves``: and what follows ticks in C."""
    functions = program.functions | ({"move": motion(stack)} if moves else {})
    return completed(functions, tables(stack, layout, program))


def tables(stack: Declaration, layout: Layout, program: TickProgram) -> dict[str, str]:
    """The headers of a stack, without what its functions in C will need."""
    return {"stack.h": header(stack, layout, program), "memory.h": structures(layout)}


Tables = dict[str, tuple[str, Iterable[float]]]


class StackNumbers(NamedTuple):
    """What C knows of a stack: sizes, and tables, each with the kind of its numbers."""

    sizes: dict[str, float]
    tables: Tables


#: Program -> numbers of its stack, which the cache and the tick are both made of
_NUMBERS: WeakKeyDictionary[TickProgram, StackNumbers] = WeakKeyDictionary()


def header(stack: Declaration, layout: Layout, program: TickProgram) -> str:
    """``stack.h``: the sizes and tables of a stack."""
    numbers = stack_numbers(stack, layout, program)
    tables = {name: np.array(numbers.tables[name][1]) for name in ("j_start", "j_col")}
    lines = [
        "/* Sizes and tables of one stack; generated */",
        "#include <stddef.h>",
        *(f"#define {name} {size.hex() if isinstance(size, float) else size}" for name, size in numbers.sizes.items()),
        *(_table(kind, name, values) for name, (kind, values) in numbers.tables.items()),
        *_blocks(tables["j_start"][: layout.leading + 1], tables["j_col"]),
    ]
    return "\n".join(lines) + "\n"


def stack_numbers(stack: Declaration, layout: Layout, program: TickProgram) -> StackNumbers:
    """Sizes and tables of the stack that a program was built for."""
    known = _NUMBERS.get(program)
    if known is None:
        known = _NUMBERS[program] = _numbers(stack, layout, program)
    return known


def _numbers(stack: Declaration, layout: Layout, program: TickProgram) -> StackNumbers:
    jt, at = program.rows.sparsity_out("jt"), program.rows.sparsity_out("at")
    j_start, j_col = sparsity_rows(jt)
    a_start, a_end, a_col = program.sensed.entries(*program.balls.entries(*sparsity_rows(at)))
    orders, scales, sequence = row_orders(layout), row_units(stack, layout), bound_sequence(layout)
    dofs, units = layout.dof_scales(stack), unit_groups(stack)
    upper = (
        ca.Sparsity(layout.variables, layout.variables)
        if program.curvature is None
        else program.curvature.sparsity_out(0)
    )
    brake_at, brake_limit = brakes(stack, layout)
    stop = stops(stack, layout)
    spare = spare_rows(stack, layout)
    forces = forces_in_loops(stack, layout)
    sizes: dict[str, float] = {
        "NQ": layout.nq,
        "NV": layout.variables,
        "NP": layout.parameters,
        "MT": layout.task_rows,
        "MC": layout.general_rows,
        "NB": layout.bound_blocks,
        "MH": layout.margin_rows,
        "NNZJ": jt.nnz(),
        "NNZA": len(a_col),
        "BALLS": len(program.balls.items),
        "SEGMENTS": len(program.balls.segment_rows),
        "SENSED": len(program.sensed.blocks),
        "FAR": FAR,
        "NNZK": upper.nnz(),
        "CALM": int(stack.calm),
        "BENDING": sum(bent_rows(layout, program)),
        "ELASTIC": int(layout.elastic),
        "REDUCED": taken_out(stack, layout),
        "REDUCED_NV": layout.variables if taken_out(stack, layout) else 0,
        "SPARED": len(spare),
        "FORCES": forces,
        "FORCED_NV": layout.variables if forces else 0,
        "FORCE_FIRST": layout.loop_forces.start,
        "CLOSING": 0 if program.arrival is None else program.arrival.numel_out("opened"),
        "CLOSING_FIRST": 0 if layout.mechanism is None else layout.mechanism.start,
        "COMMAND": COMMANDS.index(stack.command),
        "UNITS": len(units),
        "LAST_ORDER": max((o for o in orders if o < PRICED), default=0),
        "LONGEST": max(1.0, *dofs, *scales),
        "ACTIVE_MAX": layout.variables + len(orders) + 1,
    }
    tables: Tables = {
        "j_start": ("int", j_start),
        "j_col": ("int", j_col),
        "a_start": ("int", a_start),
        "a_end": ("int", a_end),
        "a_col": ("int", a_col),
        "give_order": ("int", give_order(stack, layout, at)),
        "late_row": ("int", late_rows(layout, at)),
        "spare_first": ("int", np.cumsum([0, *(len(rows) for rows, _ in spare)])),
        "spare_row": ("int", [row for rows, _ in spare for row in rows]),
        "spare_held": ("int", [held for _, held in spare]),
        "row_torque": ("int", torque_rows(stack, layout)),
        "row_order": ("int", orders),
        "bound_sequence": ("int", sequence),
        "unit_start": ("int", [u[0] for u in units]),
        "unit_size": ("int", [u[1] for u in units]),
        "k_row": ("int", upper.get_triplet()[0]),
        "k_col": ("int", upper.get_triplet()[1]),
        "bent": ("int", bent_rows(layout, program)),
        "margin_at": ("int", margin_table(layout)),
        "rate_at": ("int", rate_table(layout)),
        "gain_at": ("int", gain_table(layout)),
        "force_scale": ("double", force_scales(stack, layout, program)),
        "brake_at": ("int", brake_at),
        "brake_limit": ("double", np.where(np.isfinite(brake_limit), brake_limit, 0.0)),
        "stop_at": ("int", stop.bounds),
        "stop_row": ("int", stop.rows),
        "stop_q": ("int", np.maximum(stack.robot.position_index, 0)),
        "stop_low": ("double", np.clip(stop.lower, -1e30, 1e30)),
        "stop_high": ("double", np.clip(stop.upper, -1e30, 1e30)),
        "row_scale": ("double", scales),
        "dof_scale": ("double", dofs),
        "damping": ("double", stack.damping / dofs**2),
        **{name: ("int", values) for name, values in (program.balls.places() | program.sensed.places()).items()},
        "row_reach": ("double", program.balls.reaches),
        "segment_half": ("double", program.balls.halves),
    }
    for more in (_soft(stack, layout), _levels(stack, layout)):
        sizes |= more.sizes
        tables |= more.tables
    return StackNumbers(sizes, {name: (kind, list(values)) for name, (kind, values) in tables.items()})


def _soft(stack: Declaration, layout: Layout) -> StackNumbers:
    """What soft rows need; see ``native/tick.h``."""
    sizes: dict[str, float] = {
        "DOFS": layout.nv,
        "SOFT_ROWS": 0 if layout.cascade else sum(at >= 0 for at in layout.price_at),
        "PRICES": int(any(at >= 0 for at in layout.price_at)),
        "KEPT": int(max(kept_rows(layout), default=-1) >= 0),
        "SLEWED": len(layout.slewed[0]),
    }
    tables: Tables = {
        "kept_of": ("int", kept_rows(layout)),
        "price_at": ("int", layout.price_at),
        "slewed_at": ("int", layout.slewed[0]),
        "slewed_dof": ("int", layout.slewed[1]),
        "slack_reported": ("double", reported_slacks(stack, layout)),
    }
    return StackNumbers(sizes, tables)


def _levels(stack: Declaration, layout: Layout) -> StackNumbers:
    """What strict levels need; see ``native/tick.h``."""
    if not layout.cascade:
        return StackNumbers({"LEADING": layout.leading, "LEVELS": 0}, {})
    spans = [layout.level_rows(place) for place in range(len(layout.levels))]
    most = max(span.stop - span.start for span in spans)
    soft = [layout.row_levels.count(place) for place in range(len(spans))]
    sizes: dict[str, float] = {
        "LEADING": layout.leading,
        "LEVELS": len(spans),
        "LEVEL_NUMBERS": len(LEVEL_NUMBERS),
        "LEVEL_MOST": max(most, layout.variables + layout.general_rows),
        "SOFT_MAX": max(soft),
        "LEFT_FREE": left_free(stack),
        "DAMPING": stack.damping,
    }
    tables: Tables = {
        "level_start": ("int", [*(span.start for span in spans), layout.task_rows]),
        "row_level": ("int", layout.row_levels),
        "task_scale": ("double", layout.row_scales(stack)),
    }
    return StackNumbers(sizes, tables)


def unit_groups(stack: Declaration) -> list[tuple[int, int]]:
    """(start, size) of the coordinates in q that must have unit length: quaternions and (cos, sin) pairs."""
    model = stack.robot.tree
    groups: list[tuple[int, int]] = []

    def visit(joint: Any, start: int) -> None:
        kind = joint.shortname().removeprefix("JointModel")
        if kind.startswith(("RUB", "RevoluteUnbounded")):
            groups.append((start, 2))
        elif kind == "FreeFlyer":
            groups.append((start + 3, 4))
        elif kind == "Planar":
            groups.append((start + 2, 2))
        elif kind == "Spherical":
            groups.append((start, 4))
        elif kind == "Composite":
            for part in joint.extract().joints:
                visit(part, start)
                start += int(part.nq)

    for j in range(1, model.njoints):
        visit(model.joints[j], int(model.idx_qs[j]))
    return groups


def row_orders(layout: Layout) -> list[int]:
    """Class of each general row in the order of sacrifice."""
    classes = [int(b.entry.order) for b in layout.of_form("margins", "rows") for _ in b.rows]
    return [PRICED if at >= 0 else order for order, at in zip(classes, layout.price_at, strict=True)]


def row_units(stack: Declaration, layout: Layout) -> list[float]:
    """Size of a violation that counts as one, per general row: the characteristic length for metres."""
    rows = [row for b in layout.of_form("margins", "rows") for row in b.rows]
    return [row.scale(stack.length) for row in rows]


def bound_sequence(layout: Layout) -> list[int]:
    """Bound blocks in the order of sacrifice, then of the stack."""
    bounds = layout.of_form("bounds")
    return sorted(range(len(bounds)), key=lambda k: bounds[k].entry.order)


def _table(kind: str, name: str, values: Iterable[float]) -> str:
    """A static table; an unused last entry keeps it from being empty."""
    texts = [str(int(v)) if kind == "int" else float(v).hex() for v in values]
    return f"static const {kind} {name}[] = {{{', '.join([*texts, '0'])}}};"


def blocks(start: np.ndarray, col: np.ndarray) -> list[tuple[int, int, int, int]]:
    """(first row, rows, first entry, entries a row) of task rows with equal columns; rows of one entry together."""
    out: list[tuple[int, int, int, int]] = []
    row, rows = 0, len(start) - 1
    while row < rows:
        columns = tuple(col[start[row] : start[row + 1]])
        end = row + 1
        if len(columns) == 1:
            while end < rows and start[end + 1] - start[end] == 1:
                end += 1
        else:
            while end < rows and tuple(col[start[end] : start[end + 1]]) == columns:
                end += 1
        if columns:
            out.append((row, end - row, int(start[row]), len(columns)))
        row = end
    return out


def _blocks(start: np.ndarray, col: np.ndarray) -> list[str]:
    """BLOCKS: statements that call ``many`` for task rows of equal columns, and ``single`` for rows of one entry.
    DIAGONALS: statements that add the rows of one entry to the diagonal in ``y``.
    """
    build: list[str] = []
    diagonals: list[str] = []
    for row, count, first, columns in blocks(start, col):
        if columns > 1:
            build.append(f"many(t, {row}, {count}, {first}, {columns});")
            continue
        build.append(f"single(t, {row}, {count}, {first});")
        entry = "t->jt[e] * t->jt[e]"
        weight = f"t->weight[{row} + e - {first}] * t->report.factor[{row} + e - {first}]"
        diagonals.append(f"for (int e = {first}; e < {first + count}; e++) t->y[j_col[e]] += {weight} * {entry};")
    return [f"#define BLOCKS(many, single) {' '.join(build)}", f"#define DIAGONALS {' '.join(diagonals)}"]


def motion(stack: Declaration) -> ca.Function:
    """From one configuration to the next: ``move(q, v, dt)`` is q (+) v dt, for ticks that follow each other in C."""
    kinematics, dt = Kinematics(stack.robot.tree), ca.SX.sym("dt")
    later = kinematics.integrate(kinematics.q, kinematics.v * dt)
    return ca.Function("move", [kinematics.q, kinematics.v, dt], [ca.densify(later)], ["q", "v", "dt"], ["later"])
