"""The code that ticks share, for other machines: ``make cross`` compiles it by zig for each of them.

Looked at is that every library is of the machine's kind and shows the names that it shows here. Nothing of it is run:
``make check-export`` runs ticks of a Panda and a UR5 on aarch64 where qemu is. zig is the ``ziglang`` wheel
(``pip install wbc[compiler]``); the solver is in casadi's wheel for each machine, which pip downloads (60 MB each).
"""

from __future__ import annotations

import shutil
import struct
import sys

from bench.pool import ROOT
from tests.export.machines import EMULATORS, MISSING
from wbc.errors import CompileError
from wbc.native import targets, toolchain
from wbc.stack import ahead

#: Number of the processor's kind in a file: ELF, Mach-O, PE
KINDS = {
    ("linux", "aarch64"): 183,
    ("linux", "x86_64"): 62,
    ("darwin", "arm64"): 0x0100000C,
    ("win32", "AMD64"): 0x8664,
}


def shown(data: bytes) -> tuple[int, set[str]]:
    """Kind of processor and exported names of a library; (0, nothing) of another file."""

    def read(form: str, at: int) -> tuple[int, ...]:
        return struct.unpack_from(f"<{form}", data, at)

    def text(at: int) -> str:
        return data[at : data.index(b"\0", at)].decode()

    if data[:4] == b"\x7fELF":
        sections = [read("IIQQQQIIQQ", read("Q", 40)[0] + 64 * k) for k in range(*read("H", 60))]
        table = next(section for section in sections if section[1] == 11)  # dynamic symbols
        names = sections[table[6]][4]
        symbols = [read("IBBH", table[4] + at) for at in range(0, table[5], 24)]
        return read("H", 18)[0], {text(names + name) for name, kind, _, place in symbols if place and kind >> 4 == 1}
    if data[:4] == b"\xcf\xfa\xed\xfe":
        at, (kind,) = 32, read("I", 4)
        while read("I", at)[0] != 2:  # the table of symbols
            at += read("I", at + 4)[0]
        first, count, names, _ = read("IIII", at + 8)
        symbols = [read("IB", first + 16 * k) for k in range(count)]
        return kind, {text(names + name).removeprefix("_") for name, flags in symbols if flags & 0x1F == 0x0F}
    if data[:2] == b"MZ":
        (head,) = read("I", 0x3C)
        kind, count = read("HH", head + 4)
        first = head + 24 + read("H", head + 20)[0]
        sections = [read("IIII", first + 40 * k + 8) for k in range(count)]

        def place(address: int) -> int:
            return next(address - at + raw for size, at, _, raw in sections if at <= address < at + size)

        listed = place(read("I", head + 24 + 112)[0])
        names = place(read("I", listed + 32)[0])
        return kind, {text(place(read("I", names + 4 * k)[0])) for k in range(*read("I", listed + 24))}
    return 0, set()


def main() -> int:
    """Compile for every machine and say what came of it; the exit status."""
    here = [shown(path.read_bytes())[1] for path in ahead.build()]
    known = {name for names in here for name in names if not name.startswith("_")}
    wanted, bad = sorted(sorted(names & known) for names in here), 0
    for name in targets.OTHERS:
        folder = ROOT / "build" / "ahead" / name
        try:
            toolchain.require(targets.OTHERS[name])
            target = targets.with_solver(name, folder / "solver")
        except CompileError as error:
            print(f"not compiled for {name}: {error}", file=sys.stderr)
            return MISSING
        found = [shown(path.read_bytes()) for path in ahead.build(target, folder)]
        kinds = {kind for kind, _ in found}
        alike = (
            kinds == {KINDS[target.system, target.machine]} and sorted(sorted(n & known) for _, n in found) == wanted
        )
        size = sum(path.stat().st_size for path in folder.glob(f"*{target.suffix}")) / 1e6
        print(
            f"{name}: {len(found)} libraries, {size:.1f} MB, {len(known)} names {'as here' if alike else 'NOT as here'}"
        )
        bad += not alike
    emulator = any(shutil.which(program) for program in EMULATORS)
    print(f"run: none{'; make check-export runs ticks' if emulator else ' (no qemu here)'}")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
