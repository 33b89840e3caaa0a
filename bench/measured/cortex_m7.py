"""The exported tick of a Panda in single precision beside double, on a Cortex-M7 that qemu emulates.

Needs gcc and make; for the processor arm-none-eabi-gcc with newlib, and qemu-system-arm; and DAQP's source from the
package index. What is missing is named.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.sheet import Sheet
from tests.export.cases import panda
from tests.export.single import (
    PROGRAM,
    SINGLE,
    BuildError,
    Case,
    States,
    Ticks,
    compiled,
    in_closed_loop,
    need,
    read,
    run,
)
from wbc.export.exporting import vectors

#: States of the Panda of each family
COUNT = 500
#: Differences of commands where the statuses agree
OFF = ("commands differ by: median [rad/s]", "p99")
#: Floating-point unit, options
BUILDS = {
    "double, unit for double": ("fpv5-d16", ""),
    "double, unit for single": ("fpv5-sp-d16", ""),
    "single, unit for single": ("fpv5-sp-d16", SINGLE),
}
#: A loop of so many instructions is counted first; the clock that is read has steps of 40
LOOP, STEP = 200000, 40
QEMU = ("-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=0",
        "-semihosting-config", "enable=on,target=native", "-kernel")  # fmt: skip
#: Cycles of an instruction that are assumed: two at once from memory without waiting, and the reverse of that
CYCLES = (0.5, 2.0)
#: [1/s]
CLOCK = 480e6


def there(folder: Path, unit: str, precision: str, families: list[States]) -> tuple[list[Ticks], str]:
    """The ticks on the board, and the bytes of code and constants of a program that does nothing else."""
    sections = ("-ffunction-sections", "-fdata-sections")
    machine = ("-mcpu=cortex-m7", "-mthumb", f"-mfpu={unit}", "-mfloat-abi=hard", *sections)
    compiled(folder, " ".join(("arm-none-eabi-gcc", *machine)), precision)
    words = ["arm-none-eabi-gcc", *machine, *precision.split(), "-std=gnu99", "-O2", "-I."]
    board, start = PROGRAM.with_name("board.ld"), PROGRAM.with_name("start.c")
    link = ["libwbc_tick.a", "libdaqp.a", "-T", board, "-nostartfiles", "-Wl,--gc-sections", "-lm"]
    run(*words, "-DONLY_STEPS", start, *link, "--specs=nosys.specs", "-o", "only.elf", folder=folder)
    code = run("arm-none-eabi-size", "only.elf", folder=folder).splitlines()[1].split()[0]
    run(*words, PROGRAM, start, *link, "--specs=rdimon.specs", "-o", "states.elf", folder=folder)
    out = []
    for states in families:
        states.write(folder / "check.bin")
        text = run("qemu-system-arm", *QEMU, "states.elf", folder=folder)
        counted = text.split(None, 2)[1]
        if abs(int(counted) - LOOP) > 2 * STEP:
            raise BuildError("instructions", counted, f"qemu counts them for a loop of {LOOP}")
        out.append(read(text))
    return out, code


def parts() -> dict[str, Sheet | str]:
    """Instructions and bytes on the board, and errors of single precision there."""
    need("gcc", "make", "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm")
    c = panda()
    families = {
        "targets near the hand": States(vectors(c.clone(), COUNT), 7, 7),
        "target and ball anywhere": in_closed_loop(c.clone(), COUNT, 1),
    }
    rows = []
    with TemporaryDirectory() as place:
        folder = c.export(Path(place) / "panda", solver_source=True, states=1)
        for name, build in BUILDS.items():
            ticks, code = there(folder, *build, list(families.values()))
            rows += [
                board_row(name, family, families[family], t, code) for family, t in zip(families, ticks, strict=True)
            ]
    told = (
        "Cortex-M7",
        f"{COUNT} states each",
        "instructions of a tick: median",
        "p99",
        "largest",
        "us at 480 MHz, median",
    )
    sizes = ("code and constants [bytes]", "a controller [bytes]", "stack [bytes]", "statuses differ", *OFF)
    return {"board": Sheet("", (*told, *sizes), rows)}


def board_row(name: str, family: str, states: States, ticks: Ticks, code: str) -> tuple[str, ...]:
    """A build on the board."""
    case, count = Case("", states, ticks), ticks.instructions
    numbers = (np.median(count), np.percentile(count, 99), count.max())
    time = " to ".join(f"{1e6 * np.median(count) * cycles / CLOCK:.0f}" for cycles in CYCLES)
    off = (np.median(case.off), np.percentile(case.off, 99))
    sizes = (code, str(ticks.memory), str(ticks.stack), str(case.differ))
    return (name, family, *(f"{x:.0f}" for x in numbers), time, *sizes, *(f"{x:.1e}" for x in off))
