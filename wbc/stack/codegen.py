"""C source of one stack's tick: the generated rows, the tables, and the hand-written cycle in ``native/``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

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


def header(stack: Declaration, layout: Layout, program: TickProgram) -> str:
    """``stack.h``: the sizes and tables of a stack."""
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
    stop_at, stop_low, stop_high = stops(stack, layout)
    spare = spare_rows(stack, layout)
    forces = forces_in_loops(stack, layout)
    lines = [
        "/* Sizes and tables of one stack; generated */",
        "#include <stddef.h>",
        *(
            f"#define {name} {value}"
            for name, value in {
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
            }.items()
        ),
        _table("int", "j_start", j_start),
        _table("int", "j_col", j_col),
        _table("int", "a_start", a_start),
        _table("int", "a_end", a_end),
        _table("int", "a_col", a_col),
        _table("int", "give_order", give_order(stack, layout, at)),
        _table("int", "late_row", late_rows(layout, at)),
        _table("int", "spare_first", np.cumsum([0, *(len(rows) for rows, _ in spare)])),
        _table("int", "spare_row", [row for rows, _ in spare for row in rows]),
        _table("int", "spare_held", [held for _, held in spare]),
        _table("int", "row_torque", torque_rows(stack, layout)),
        _table("int", "row_order", orders),
        _table("int", "bound_sequence", sequence),
        _table("int", "unit_start", [u[0] for u in units]),
        _table("int", "unit_size", [u[1] for u in units]),
        _table("int", "k_row", upper.get_triplet()[0]),
        _table("int", "k_col", upper.get_triplet()[1]),
        _table("int", "bent", bent_rows(layout, program)),
        _table("int", "margin_at", margin_table(layout)),
        _table("int", "rate_at", rate_table(layout)),
        _table("int", "gain_at", gain_table(layout)),
        _table("double", "force_scale", force_scales(stack, layout, program)),
        _table("int", "brake_at", brake_at),
        _table("double", "brake_limit", np.where(np.isfinite(brake_limit), brake_limit, 0.0)),
        _table("int", "stop_at", stop_at),
        _table("int", "stop_q", np.maximum(stack.robot.position_index, 0)),
        _table("double", "stop_low", np.clip(stop_low, -1e30, 1e30)),
        _table("double", "stop_high", np.clip(stop_high, -1e30, 1e30)),
        _table("double", "row_scale", scales),
        _table("double", "dof_scale", dofs),
        _table("double", "damping", stack.damping / dofs**2),
        *(_table("int", name, values) for name, values in (program.balls.places() | program.sensed.places()).items()),
        _table("double", "row_reach", program.balls.reaches),
        _table("double", "segment_half", program.balls.halves),
        *_soft(stack, layout),
        *_levels(stack, layout),
        *_blocks(j_start[: layout.leading + 1], j_col),
    ]
    return "\n".join(lines) + "\n"


def _soft(stack: Declaration, layout: Layout) -> list[str]:
    """What soft rows need; see ``native/tick.h``."""
    return [
        f"#define DOFS {layout.nv}",
        f"#define SOFT_ROWS {0 if layout.cascade else sum(at >= 0 for at in layout.price_at)}",
        f"#define PRICES {int(any(at >= 0 for at in layout.price_at))}",
        f"#define KEPT {int(max(kept_rows(layout), default=-1) >= 0)}",
        _table("int", "kept_of", kept_rows(layout)),
        _table("int", "price_at", layout.price_at),
        f"#define SLEWED {len(layout.slewed[0])}",
        *(_table("int", name, each) for name, each in zip(("slewed_at", "slewed_dof"), layout.slewed, strict=True)),
        _table("double", "slack_reported", reported_slacks(stack, layout)),
    ]


def _levels(stack: Declaration, layout: Layout) -> list[str]:
    """What strict levels need; see ``native/tick.h``."""
    if not layout.cascade:
        return [f"#define LEADING {layout.leading}", "#define LEVELS 0"]
    spans = [layout.level_rows(place) for place in range(len(layout.levels))]
    most = max(span.stop - span.start for span in spans)
    soft = [layout.row_levels.count(place) for place in range(len(spans))]
    return [
        f"#define LEADING {layout.leading}",
        f"#define LEVELS {len(spans)}",
        f"#define LEVEL_NUMBERS {len(LEVEL_NUMBERS)}",
        f"#define LEVEL_MOST {max(most, layout.variables + layout.general_rows)}",
        f"#define SOFT_MAX {max(soft)}",
        f"#define LEFT_FREE {left_free(stack).hex()}",
        f"#define DAMPING {stack.damping.hex()}",
        _table("int", "level_start", [*(span.start for span in spans), layout.task_rows]),
        _table("int", "row_level", layout.row_levels),
        _table("double", "task_scale", layout.row_scales(stack)),
    ]


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
