"""``print(controller)``: every item with level, weight, gain, rows and units."""

from __future__ import annotations

from collections.abc import Mapping

from wbc.controller.handle import Handle
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout

_HEAD = ("item", "kind", "level", "weight", "gain or rate", "rows", "unit", "on")


def describe(stack: Declaration, layout: Layout, handles: Mapping[str, Handle], solver: str) -> str:
    """The table as text."""
    robot = stack.robot
    lines = [_row(handles[name], block) for name, block in layout.blocks.items()]
    widths = [max(len(r[k]) for r in [_HEAD, *lines]) for k in range(len(_HEAD))]
    head = (
        f"{robot.name}: {robot.nv} degrees of freedom, dt {stack.dt:g} s "
        f"({stack.dt_range[0]:g} to {stack.dt_range[1]:g}), {solver}, "
        f"characteristic length {stack.length:.3g} m, damping {stack.damping:g}"
    )
    text = [head]
    for r in [_HEAD, tuple("-" * w for w in widths), *lines]:
        text.append("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip())
    return "\n".join(text)


def _row(handle: Handle, block: Block) -> tuple[str, ...]:
    speed = "gain" if block.form == "task" else "rate"
    rate = f"{getattr(handle, speed):g} 1/s" if speed in block.slots else "-"
    kind_of_row = "minimised" if block.entry.level > 0 else "hard" if block.entry.hard else "soft"
    if "price" in block.slots:
        kind_of_row = f"soft, {handle.price:g}"
    weight = f"{handle.weight:g}" if block.form == "task" else kind_of_row
    units = ", ".join(dict.fromkeys(r.unit or "1" for r in block.rows))
    mask = handle.mask
    rows = f"{len(block.rows)}" if mask.all() else f"{int((mask > 0).sum())} of {len(block.rows)}"
    kind = type(block.entry.item).__name__
    return (
        block.entry.name,
        kind,
        str(block.entry.level),
        weight,
        rate,
        rows,
        units,
        "yes" if handle.enabled else "no",
    )
