"""Object files of compiled stacks, kept by what they are made from.

A stack is compiled again as soon as a line of the package changes that may have to do with it (wbc.stack.key); nearly
always the C code stays the same, and so does its object file. What is not in the folder is compiled; rows that are not
to be optimised are assembled (:mod:`tests.assembly`), and what then belongs together is linked without asking the
compiler to ask the linker, which takes as long again.

Code that the compiler refuses fails the test: the package itself would go on, slowly, on the virtual machine.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pathlib
import shutil
import subprocess
import tempfile
from collections.abc import Callable

import casadi as ca

from tests.assembly import assembled
from wbc.errors import CompileError
from wbc.native import kernel, toolchain

_run, _compiler = toolchain._run, toolchain.compiler()
#: Empty file beside a tick that is not optimised
_PLAIN = "plain"
#: Its functions that are always put in place are called: they are a third of its machine code
_CALLED = ["-Dalways_inline=unused"]
#: The tick for stacks of any size, and its optimisation here: 1.1 s to compile where -O1 takes 2.4 s, and as fast
_GENERIC, _GENERIC_FLAG = "generic.c", "-Og"
#: Hand-written libraries in which tests spend longer than the 0.7 s that -O3 costs
_BUSY = {"planner.c", "sweep.c"}


def keep(folder: pathlib.Path) -> None:
    """From now on this process takes object files from the folder where it can. Another compiler is always asked."""
    folder.mkdir(parents=True, exist_ok=True)

    def run(command: list[str], place: pathlib.Path) -> None:
        if command[0] != _compiler:
            _run(command, place)
            return
        try:
            compile_or_take(command, place)
        except CompileError as error:
            raise AssertionError(f"the package's C code does not compile: {error}") from error

    def compile_or_take(command: list[str], place: pathlib.Path) -> None:
        if _GENERIC in command:
            command = [_GENERIC_FLAG if word == "-O1" else word for word in command]
        elif {"rows.o", "tick.o"} <= {*command}:
            _run(_linked(command) if (place / _PLAIN).exists() else command, place)
            return
        elif "-c" not in command and not _BUSY & {*command}:
            # A hand-written library
            command = ["-O1" if word == "-O3" else word for word in command]
        if "tick.o" in command and "-O0" in command:
            (place / _PLAIN).touch()
            command = [*command, *_CALLED]
        made = place / command[command.index("-o") + 1]
        kept = folder / _name(command, place)
        if kept.exists():
            shutil.copyfile(kept, made)
            return
        _made(command, place)
        # Renamed into its place, since other processes look for it
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            file.write(made.read_bytes())
        os.replace(file.name, kept)

    toolchain._run = run
    # What was compiled when the package was installed need not be made again for this very processor
    kernel.library = functools.partial(kernel.library, at_once=True)
    kernel.kernel = functools.partial(_at_once, kernel.kernel)


def _at_once(
    kernel: Callable[..., pathlib.Path], main: pathlib.Path, *folders: pathlib.Path, **_: bool
) -> pathlib.Path:
    return kernel(main, *folders, at_once=True)


def _made(command: list[str], place: pathlib.Path) -> None:
    """By the compiler, or, where generated rows are not to be optimised, by the assembler."""
    rows = place / "rows.c"
    if {rows.name, "-O0", "-c"} <= {*command}:
        text = assembled(rows.read_text())
        if text is not None:
            (place / "rows.s").write_text(text)
            _run([_tool("as"), "rows.s", "-o", command[command.index("-o") + 1]], place)
            return
    _run(command, place)


def _linked(command: list[str]) -> list[str]:
    """The linker's command that the compiler's stands for, without the start-up code that a tick does not have."""
    return [_tool("ld"), *(flag for word in command[1:] for flag in word.removeprefix("-Wl,").split(","))]


@functools.cache
def _tool(name: str) -> str:
    """The assembler or the linker that the compiler calls."""
    assert _compiler is not None
    done = subprocess.run([_compiler, f"-print-prog-name={name}"], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def _name(command: list[str], place: pathlib.Path) -> str:
    """Of the command, the compiler, the solver's headers, and what is compiled: the rows are straight-line code that
    includes nothing, and nothing includes them, so that stacks of one layout share their tick.
    """
    words = [word for word in command if not word.endswith(".so")]
    digest = hashlib.sha256("\n".join([*words, toolchain.identity(), ca.__version__]).encode())
    rows = place / "rows.c"
    for path in [rows] if rows.name in command else sorted({*place.glob("*.[ch]")} - {rows}):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest() + ".o"
