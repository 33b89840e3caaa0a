"""Exported C on another machine: ``make check-export`` builds it for aarch64 with zig and runs it under qemu.

The check of the export itself runs: commands at 1000 states, beside those that this machine computed. zig is the
``ziglang`` wheel (``pip install wbc[compiler]``), qemu is ``qemu-aarch64`` or ``qemu-aarch64-static``, and DAQP for
aarch64 comes from casadi's wheel for that machine, which pip downloads (55 MB) unless ``--daqp`` names its archive.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from bench.pool import ROOT
from tests.export.cases import CASES
from wbc.errors import CompileError
from wbc.native import targets, toolchain

TARGET = "aarch64-linux-musl"
EMULATORS = ("qemu-aarch64", "qemu-aarch64-static")
#: Exit code where something that the check needs is not installed
MISSING = 3
FOLDER = ROOT / "build" / "export-aarch64"


def missing(what: str) -> SystemExit:
    """The end of a check that cannot be made."""
    print(f"not checked: {what}", file=sys.stderr)
    return SystemExit(MISSING)


def run(*command: str | Path, folder: Path) -> str:
    """What a command prints; the program ends where it fails."""
    done = subprocess.run([str(part) for part in command], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout.strip()


def solver(folder: Path) -> Path:
    """DAQP for the other machine, of the version of casadi that is installed here."""
    try:
        return toolchain.library(targets.with_solver("linux-aarch64", folder))
    except CompileError as error:
        raise missing(f"{error}; --daqp names the archive") from error


def main() -> None:
    """Export, build and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", default=sys.executable, help="Python that has ziglang.")
    parser.add_argument("--qemu", default="", help="The emulator; default: on the PATH.")
    parser.add_argument("--daqp", type=Path, help="libdaqpstat.a for aarch64.")
    parser.add_argument("--cases", nargs="+", default=["panda", "ur5"], choices=list(CASES))
    given = parser.parse_args()
    emulator = given.qemu or next((path for name in EMULATORS if (path := shutil.which(name))), None)
    if emulator is None:
        raise missing("there is no qemu-aarch64 on the PATH (Debian: qemu-user-static)")
    if subprocess.run([given.python, "-c", "import ziglang"], capture_output=True, check=False).returncode:
        raise missing("no ziglang; pip install wbc[compiler]")
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    archive = solver(FOLDER) if given.daqp is None else given.daqp.resolve()
    zig = (given.python, "-m", "ziglang", "cc", "-target", TARGET, "-fno-sanitize=undefined", "-std=c99", "-O1")
    exact = ("-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Idaqp/include")
    for name in given.cases:
        folder = CASES[name]().export(FOLDER / name)
        for part in ("wbc_tick", "wbc_rows"):
            run(*zig, *exact, "-c", f"{part}.c", "-o", f"{part}.o", folder=folder)
        run(*zig, "check.c", "wbc_tick.o", "wbc_rows.o", archive, "-lm", "-o", "check", folder=folder)
        print(f"{name} on {TARGET}: {run(emulator, './check', 'check.bin', folder=folder)}")


if __name__ == "__main__":
    main()
