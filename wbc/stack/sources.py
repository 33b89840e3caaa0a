"""The C of one stack's tick from its CasADi functions; imports only CasADi, so that a process of its own is quick."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Mapping

import casadi as ca

from wbc.stack.handing_over import hand_over

#: Outputs of the rows that stand behind what they hand to the curvature
_LAST = ("segment", "screw")


def completed(functions: Mapping[str, ca.Function], tables: Mapping[str, str]) -> dict[str, str]:
    """File name -> text of everything that makes the tick of a stack.

    Args:
        functions: of :attr:`wbc.stack.program.TickProgram.functions`, with ``move`` for what follows ticks in C.
        tables: of :func:`wbc.stack.codegen.tables`.
    """
    native = pathlib.Path(__file__).parent / "native"
    written = {file.name: file.read_text() for file in native.iterdir() if file.name.endswith((".c", ".h"))}
    compiled = {name: _shared(function) for name, function in functions.items()}
    place = sum(name not in _LAST for name in compiled["rows"].name_out())
    sizes = {"HANDED": 0, "HANDED_TO_LOST": -1, "HANDED_TO_TORQUE": -1}
    # In the order of the outputs; of what is lost, v is a command and not the last one
    for name, output, others in (
        ("torque", "handed_to_torque", ()),
        ("lost", "handed_to_lost", ("v",)),
        ("curvature", "handed", ()),
    ):
        if name in compiled:
            compiled["rows"], compiled[name] = hand_over(compiled["rows"], compiled[name], place, output, others)
            sizes[output.upper()] = compiled["rows"].numel_out(output)
    sizes |= {
        "WORK_W": max(function.sz_w() for function in compiled.values()),
        "WORK_IW": max(function.sz_iw() for function in compiled.values()),
    }
    lines = "".join(f"#define {name} {size}\n" for name, size in sizes.items())
    return {
        "rows.c": casadi_source(list(compiled.values())),
        **tables,
        "stack.h": tables["stack.h"] + lines,
        **written,
    }


def _shared(function: ca.Function) -> ca.Function:
    """The same function, with what occurs in it twice computed once: to the same bits, and a twentieth quicker.

    To find that takes a quarter of the time of a new stack, which a stack that answers at once does without.
    """
    given = [ca.SX.sym(name, function.sparsity_in(k)) for k, name in enumerate(function.name_in())]
    found = ca.cse(function.call(given))
    return ca.Function(function.name(), given, found, function.name_in(), function.name_out())


def casadi_source(functions: list[ca.Function]) -> str:
    """Functions as C, to the same bits as on the virtual machine but for the sign of zeros."""
    generator = ca.CodeGenerator("rows.c", {"with_header": False})
    for function in functions:
        generator.add(function)
    text = str(generator.dump())
    # The library's are calls; the same here, of NaN the other argument, but for the sign of zeros
    for name, sign in (("fmin", "<"), ("fmax", ">")):
        text = text.replace(f"return {name}(x, y);", f"return x {sign} y || y != y ? x : y;")
    # Helpers of a line; at the level that the rows are compiled at, others are calls
    return re.sub(r"^(casadi_real casadi_\w+\()", r"static inline \1", text, flags=re.MULTILINE)
