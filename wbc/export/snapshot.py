"""What an export is made of: the declaration and a controller's values at that moment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.stack import codegen
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.program import build
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A stack with run-time values.

    Attributes:
        stack, layout: the declaration and its buffers.
        q: configuration [nq]. p: run-time inputs. weight, enabled, bound_enabled: as in the buffers.
        cost: weight of each task row where its item has weight 1.
        cap: iterations a tick at most, 0 for no cap.
        version: of this package.
        states: a test vector, a state a row: q, v measured, p, flag, v commanded.
        author: which tick the commands of ``states`` are from.
        agrees: how far the commands of the C code may be from those [rad/s, m/s].
    """

    stack: Declaration
    layout: Layout
    q: Array
    p: Array
    weight: Array
    cost: Array
    enabled: Array
    bound_enabled: Array
    cap: float
    version: str
    states: Array
    author: str
    agrees: float

    @cached_property
    def sources(self) -> dict[str, str]:
        """Text of the files that make the tick, by name: what ``tick.c`` includes, and the generated rows."""
        every = codegen.sources(self.stack, self.layout, build(self.stack, self.layout), moves=True)
        wanted, waiting = {"rows.c": every["rows.c"]}, ["tick.c"]
        while waiting:
            name = waiting.pop()
            wanted[name] = every[name]
            included = [line.split('"')[1] for line in every[name].splitlines() if line.startswith('#include "')]
            waiting += [other for other in included if other in every and other not in wanted]
        return wanted

    @cached_property
    def values(self) -> str:
        """``values.h``: what ``wbc_init`` sets."""
        arrays = {
            "first_q": self.q,
            "first_p": self.p,
            "first_weight": self.weight,
            "first_enabled": self.enabled,
            "first_bound_enabled": self.bound_enabled,
            "row_cost": self.cost,
        }
        lines = [f"static const double {n}[] = {{{', '.join([*numbers(a), '0'])}}};" for n, a in arrays.items()]
        lines += [f"#define FIRST_DT {self.stack.dt.hex()}", f"#define FIRST_CAP {self.cap:g}"]
        low, high = self.stack.dt_range
        lines += [f"#define LEAST_DT {float(low).hex()}", f"#define LARGEST_DT {float(high).hex()}"]
        return "/* Values at the time of the export; generated */\n" + "\n".join(lines) + "\n"


def numbers(values: Array) -> list[str]:
    """Numbers as C writes them, exactly."""
    return ["HUGE_VAL" if np.isposinf(v) else "-HUGE_VAL" if np.isneginf(v) else float(v).hex() for v in values]
