"""How much memory a tick needs, from the table of its fields and the text of the rest: known without a compiler."""

from __future__ import annotations

import re

from wbc.stack.layout import Layout
from wbc.stack.memory import Memory

#: Bytes of what the fields are, a pointer counted as 8; those of DAQP are bounds, which the compiler checks
_BYTES = {"double": 8, "long long": 8, "int": 4, "DAQPWorkspace": 1024, "DAQPProblem": 256, "DAQPSettings": 512}
_DEFINE = re.compile(r"^#define (\w+) +([-+*/() \w]+?)\s*$", re.MULTILINE)
_STRUCT = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
_BLOCK = re.compile(r"^#if (LEVELS|SOFT_ROWS) > 0$(.*?)^#endif$", re.DOTALL | re.MULTILINE)
_FIELD = re.compile(r"\s*(\w+)\s*(?:\[(.+)\])?\s*$", re.DOTALL)


def bytes_of_tick(tick: str, stack: str, layout: Layout, number: int = 8) -> int:
    """Bound on the size of ``wbc_tick``.

    Args:
        tick: text of ``tick.h``. stack: text of ``stack.h``. layout: that of both.
        number: bytes of a number, 4 in single precision.
    """
    known = dict(_DEFINE.findall(stack + tick))
    sizes, known_fields = _BYTES | {"double": number}, number * Memory(layout).size
    tick = tick.replace("WBC_BUFFERS", "")
    tick = _BLOCK.sub(lambda block: block[2] if int(known[block[1]]) > 0 else "", tick)
    for body, name in _STRUCT.findall(re.sub(r"/\*.*?\*/", "", tick, flags=re.DOTALL)):
        sizes[name] = sum(_bytes(declaration, sizes, known) for declaration in body.split(";") if declaration.strip())
    return (sizes["wbc_tick"] + known_fields) // 64 * 64 + 64


def _bytes(declaration: str, sizes: dict[str, int], known: dict[str, str]) -> int:
    text = " ".join(declaration.split())
    kind = next(k for k in sorted(sizes, key=len, reverse=True) if text.startswith(f"{k} "))
    total = 0
    for field in text[len(kind) :].split(","):
        match = _FIELD.match(field)
        assert match is not None, field
        # 8 for the padding that may follow
        total += sizes[kind] * (_value(match[2], known) if match[2] else 1) + 8
    return total


def _value(expression: str, known: dict[str, str]) -> int:
    """A constant expression of integers; C's division rounds down for what is not negative."""
    while names := set(re.findall(r"[A-Za-z_]\w*", expression)):
        for name in names:
            expression = re.sub(rf"\b{name}\b", f"({known[name]})", expression)
    return int(eval(expression.replace("/", "//"), {"__builtins__": {}}))
