"""The tick as C beside the Python tick, as tables."""

from __future__ import annotations

from typing import Any

from bench.sheet import Sheet

NOTE = """\
The tick as C: `controller.export` of the problem above, built by its own Makefile with gcc, and once more for this \
processor, along the states and run-time inputs of the Python tick, which runs in turns with it. Cycles are those of \
the processor's time stamp counter (rdtsc between fences, constant rate: not the core's clock) around `wbc_step`; \
nanoseconds are of other passes, by clock_gettime. Neither is corrected for its own reading, {reading}. Instructions \
and, by perf, cycles of the core are means over passes, in user space, counted by what the row says: perf stat, or \
valgrind where the processor shows no counters; valgrind cannot run the instructions of every processor. Differences \
are of all commands from Python's."""


def sheet(measured: dict[str, Any]) -> Sheet:
    """One problem."""
    columns = (
        "one tick", "cycles", "p99.9", "ns", "p99", "p99.9", "max", "instructions", "core cycles", "counted by",
        "largest difference [rad/s]",
    )  # fmt: skip
    rows = []
    for row in measured["rows"]:
        cycles = [f"{row['cycles'][part]:.0f}" for part in ("median", "p99.9")] if row["cycles"] else ["-", "-"]
        times = [f"{row['ns'][part]:.0f}" for part in ("median", "p99", "p99.9", "max")]
        counts = [f"{row['counts'][part]:.0f}" if part in row["counts"] else "-" for part in ("instructions", "cycles")]
        difference = f"{row['difference']:.0e}" if "difference" in row else "-"
        rows.append((row["what"], *cycles, *times, *counts, ways(row), difference))
    return Sheet(f"The tick as C. {measured['title']} ({measured['ticks']} ticks each)", columns, rows)


def ways(row: dict[str, Any]) -> str:
    """What counted."""
    found = ["rdtsc"] if row["cycles"] else []
    found += ["clock_gettime" if "difference" in row else "perf_counter_ns"]
    return ", ".join([*found, row["counter"]] if row["counts"] else found)


def note(measured: dict[str, dict[str, Any]]) -> str:
    """What the reader must know."""
    first = next(iter(measured.values()))["rows"][0]
    reading = f"some {first['read cycles']:.0f} cycles and {first['read ns']:.0f} ns"
    return NOTE.format(reading=reading)
