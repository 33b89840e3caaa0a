"""Generated rows as assembly: what gcc makes of them without optimisation, in a tenth of its time.

A line of CasADi's C code is one operation on doubles; here it becomes the two or three instructions that gcc -O0 makes
of it, so that the bits are the same (``tests/controller/test_optimised.py`` compares them with rows that gcc has
optimised). Code with any other line is left to gcc.
"""

from __future__ import annotations

import re
import struct
import sys
from platform import machine

_CALL = r"(\w+)\((a\d+)(?:,(a\d+))?\)"
_LINE = re.compile(
    r"  (?:(a\d+)=(?:"
    r"arg\[(\d+)\]\? arg\[\2\]\[(\d+)\] : 0"
    r"|\((\S+?)([-+*/<]|<=|==|!=|&&|\|\|)(a\d+|[.e\d]+|[.\d]+e-\d+)\)"
    r"|\((-|!)(a\d+)\)"
    r"|\((a\d+)\?(a\d+):0\)"
    rf"|{_CALL}"
    r"|([-+.\w]+))"
    r"|if \(res\[(\d+)\]!=0\) res\[\15\]\[(\d+)\]=(a\d+));"
)
_FUNCTION = re.compile(r"^static int (casadi_f\d+)\(.*?\) \{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
_NAME = re.compile(r"^CASADI_SYMBOL_EXPORT int (\w+)\(const.*?\)\s*\{\n\s*return (casadi_f\d+)\(", re.MULTILINE)
_ARITHMETIC = {"+": "addsd", "-": "subsd", "*": "mulsd", "/": "divsd"}
_COMPARED = {"<": "cmpltsd", "<=": "cmplesd", "==": "cmpeqsd", "!=": "cmpneqsd"}
#: Functions of C's library, by the names that they have in generated code
_SAME = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "floor", "ceil")
_LIBRARY = dict(zip(_SAME, _SAME, strict=True)) | {"casadi_fmax": "fmax", "casadi_fmin": "fmin"}
_NAMED = {"casadi_inf": float("inf"), "-casadi_inf": -float("inf"), "casadi_nan": float("nan")}


class _UnknownLineError(Exception):
    """Something that is not translated."""


def assembled(text: str) -> str | None:
    """The assembly of a C text of straight-line functions; None where gcc has to do it."""
    if machine() != "x86_64" or sys.platform != "linux":
        return None
    names = {inner: name for name, inner in _NAME.findall(text)}
    constants: dict[float | str, str] = {}
    try:
        parts = [_function(names[inner], body, constants) for inner, body in _FUNCTION.findall(text)]
    except (_UnknownLineError, KeyError):
        return None
    if not parts or len(parts) != len(names):
        return None
    numbers = [f"{label}: .quad {bits}" for bits, label in constants.items()]
    masks = ["minus: .quad 0x8000000000000000, 0", "size: .quad 0x7fffffffffffffff, 0", "one: .double 1.0"]
    stack = '.section .note.GNU-stack,"",@progbits'
    return "\n".join([".text", *parts, ".section .rodata", ".balign 16", *masks, *numbers, stack, ""])


def _function(name: str, body: str, constants: dict[float | str, str]) -> str:
    """One function: every variable has its place on the stack, as without optimisation."""
    count = 1 + max((int(n) for n in re.findall(r"\ba(\d+)=", body)), default=0)
    room = 8 * (count + 1 - count % 2)  # with two registers and the way back the stack stays aligned to 16
    out = [f".globl {name}", f".hidden {name}", f".type {name}, @function", f"{name}:"]
    out += ["pushq %rbx", "pushq %r12", f"subq ${room}, %rsp", "movq %rdi, %rbx", "movq %rsi, %r12"]

    def number(value: float) -> str:
        bits = hex(struct.unpack("<Q", struct.pack("<d", value))[0])
        return f"{constants.setdefault(bits, f'number{len(constants)}')}(%rip)"

    def at(variable: str) -> str:
        return f"{8 * int(variable[1:])}(%rsp)" if variable[0] == "a" else number(float(variable))

    for line in body.splitlines():
        if line.startswith("  casadi_real ") or line in ("  return 0;", ""):
            continue
        found = _LINE.fullmatch(line)
        if found is None:
            raise _UnknownLineError(line)
        to, arg, k, left, sign, right, unary, of, which, chosen, call, one, two, value, res, row, given = found.groups()
        if res is not None:
            out += [f"movq {8 * int(res)}(%r12), %rax", "testq %rax, %rax", "je 1f", f"movsd {at(given)}, %xmm0"]
            out += [f"movsd %xmm0, {8 * int(row)}(%rax)", "1:"]
            continue
        if arg is not None:
            out += ["xorpd %xmm0, %xmm0", f"movq {8 * int(arg)}(%rbx), %rax", "testq %rax, %rax", "je 1f"]
            out += [f"movsd {8 * int(k)}(%rax), %xmm0", "1:"]
        elif sign in _ARITHMETIC:
            out += [f"movsd {at(left)}, %xmm0", f"{_ARITHMETIC[sign]} {at(right)}, %xmm0"]
        elif sign in _COMPARED:
            out += [f"movsd {at(left)}, %xmm0", f"{_COMPARED[sign]} {at(right)}, %xmm0"]
            out += ["movsd one(%rip), %xmm1", "andpd %xmm1, %xmm0"]
        elif sign is not None:
            out += ["xorpd %xmm1, %xmm1", f"movsd {at(left)}, %xmm0", "cmpneqsd %xmm1, %xmm0"]
            out += [f"movsd {at(right)}, %xmm2", "cmpneqsd %xmm1, %xmm2"]
            out += ["andpd %xmm2, %xmm0" if sign == "&&" else "orpd %xmm2, %xmm0"]
            out += ["movsd one(%rip), %xmm1", "andpd %xmm1, %xmm0"]
        elif unary == "-":
            out += [f"movsd {at(of)}, %xmm0", "xorpd minus(%rip), %xmm0"]
        elif unary == "!":
            out += ["xorpd %xmm0, %xmm0", f"cmpeqsd {at(of)}, %xmm0", "movsd one(%rip), %xmm1", "andpd %xmm1, %xmm0"]
        elif which is not None:
            out += ["xorpd %xmm0, %xmm0", f"cmpneqsd {at(which)}, %xmm0", f"movsd {at(chosen)}, %xmm1"]
            out += ["andpd %xmm1, %xmm0"]
        elif call == "casadi_sq":
            out += [f"movsd {at(one)}, %xmm0", "mulsd %xmm0, %xmm0"]
        elif call == "casadi_fabs":
            out += [f"movsd {at(one)}, %xmm0", "andpd size(%rip), %xmm0"]
        elif call == "sqrt":
            out += [f"sqrtsd {at(one)}, %xmm0"]
        elif call in _LIBRARY:
            out += [f"movsd {at(one)}, %xmm0", *([f"movsd {at(two)}, %xmm1"] if two else [])]
            out += [f"call {_LIBRARY[call]}@PLT"]
        elif value is not None:
            try:
                out += [f"movsd {number(_NAMED[value] if value in _NAMED else float(value))}, %xmm0"]
            except ValueError:
                raise _UnknownLineError(line) from None
        else:
            raise _UnknownLineError(line)
        out += [f"movsd %xmm0, {at(to)}"]
    return "\n".join([*out, f"addq ${room}, %rsp", "popq %r12", "popq %rbx", "xorl %eax, %eax", "ret"])
