"""The C compiler and the static DAQP library that the casadi wheel ships."""

from __future__ import annotations

import functools
import importlib.util
import logging
import os
import pathlib
import re
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import casadi as ca

from wbc.errors import CompileError
from wbc.native.targets import HERE, TargetMachine

log = logging.getLogger("wbc")

#: Flags of the generated rows: straight-line code, on which higher levels cost minutes and gain nothing; that numbers
#: and pointers to numbers are apart spares it a sixth. ``WBC_ROWS_FLAGS`` replaces them: at -O0 they compile in half
#: the time, to the same arithmetic
ROWS_FLAGS = tuple(os.environ.get("WBC_ROWS_FLAGS", "-O1 -fstrict-aliasing").split())
#: Generated code longer than this [characters] is compiled at -O0: the time of -O1 grows faster than the code
LONG_ROWS = 1_000_000
#: Flags of the hand-written cycle: its loops have constant bounds and are worth unrolling. ``WBC_TICK_FLAGS`` replaces
#: them, as above
TICK_FLAGS = tuple(os.environ.get("WBC_TICK_FLAGS", "-O3").split())
#: No fast-math and no contraction, so that the compiled tick is the arithmetic that was written
COMMON_FLAGS = (
    "-std=gnu99",
    "-fPIC",
    "-march=native",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-DCASADI_SYMBOL_EXPORT=",
    "-w",
)

#: What needs no compiler
WITHOUT = "a wheel of `make wheel`, or an installation made where a compiler is, brings compiled code"


@functools.cache
def compiler() -> str | None:
    """Path of the C compiler, or None: ``WBC_CC`` if set (empty: none), else gcc or cc on the PATH, else the zig of the
    ``ziglang`` wheel, which is a clang with its own headers and linker.
    """
    chosen = os.environ.get("WBC_CC")
    if chosen is not None:
        return _on_path(chosen) if chosen else None
    return _on_path("gcc") or _on_path("cc") or _wheel()


def _on_path(program: str) -> str | None:
    """``shutil.which``; on POSIX without importing it for a plain name, which takes 4 ms."""
    if os.name == "posix" and os.sep not in program:
        places = (os.path.join(folder, program) for folder in os.get_exec_path())
        return next((place for place in places if os.path.isfile(place) and os.access(place, os.X_OK)), None)
    import shutil

    return shutil.which(program)


def _wheel() -> str | None:
    """Path of zig in the ``ziglang`` wheel."""
    import shutil

    found = importlib.util.find_spec("ziglang")
    folders = found.submodule_search_locations if found is not None else None
    return shutil.which("zig", path=os.pathsep.join(folders)) if folders else None


def _is_zig(cc: str) -> bool:
    return pathlib.Path(cc).stem == "zig"


def _command(cc: str, target: TargetMachine | None = None) -> list[str]:
    """What a command line of the compiler begins with; zig would trap undefined behaviour at -O0."""
    kind = ["-target", target.triple] if target and target.triple else []
    return [cc, "cc", "-fno-sanitize=undefined", *kind] if _is_zig(cc) else [cc]


@functools.cache
def missing() -> tuple[str, ...]:
    """What is not there and native ticks need; empty where all is."""
    out = []
    if compiler() is None:
        chosen = os.environ.get("WBC_CC")
        why = (
            "neither gcc nor cc is on the PATH; pip install wbc[compiler] brings one"
            if chosen is None
            else f"WBC_CC is {chosen!r}"
        )
        out.append(f"no C compiler ({why})")
    if not (library().exists() and (headers() / "daqp" / "api.h").exists()):
        out.append("no static daqp library in the casadi package")
    return tuple(out)


def available() -> bool:
    """A compiler and DAQP's library and headers are there. Says once in the log if not."""
    if missing():
        fall_back(" and ".join(missing()))
    return not missing()


def reason(error: CompileError) -> str:
    """What to say of code that could not be compiled: the same where it is for want of a compiler."""
    return " and ".join(missing()) or str(error)


def require(target: TargetMachine = HERE) -> None:
    """Nothing that native ticks need is missing.

    Raises:
        CompileError: something is.
    """
    if target.triple:
        _compiler_for(target)
    elif missing():
        raise CompileError("compiler", compiler(), f"cannot compile: {', '.join(missing())}; {WITHOUT}")


@functools.cache
def fall_back(reason: str) -> None:
    """Say once for each reason that ticks are not native."""
    log.warning(
        "%s: rows run on CasADi's virtual machine, and a tick takes 3 to 5 times as long",
        reason,
    )


def headers(target: TargetMachine = HERE) -> pathlib.Path:
    """Include folder of the casadi wheel."""
    return target.casadi / "include"


def library(target: TargetMachine = HERE) -> pathlib.Path:
    """Static DAQP library of the casadi wheel."""
    return target.casadi / "libdaqpstat.a"


@functools.cache
def identity() -> str:
    """Compiler version, target processor and flags: part of the cache key of a stack."""
    return "\n".join([machine(), *ROWS_FLAGS, *TICK_FLAGS])


@functools.cache
def machine() -> str:
    """Compiler version, target processor and flags of all code, with the version of the solver."""
    cc = compiler()
    if cc is None:
        return "none"
    version = _output([*_command(cc), "--version"]).splitlines()[:1]
    asked = ("-dM", "-E", "-x", "c", os.devnull) if _is_zig(cc) else ("-Q", "--help=target")
    target = _output([*_command(cc), "-march=native", *asked])
    return "\n".join([*version, target, *COMMON_FLAGS, solver_version()])


def solver_version() -> str:
    """Of the casadi wheel, whose DAQP is linked."""
    return str(ca.CasadiMeta.version())


def compile_tick(files: dict[str, str], output: pathlib.Path, search: bool = False) -> None:
    """Compile the files of :func:`wbc.stack.codegen.sources` to a shared library at ``output``.

    ``search``: with inverse kinematics, which a controller does without: it takes a quarter of a second more.

    Raises:
        CompileError: the compiler failed; its first lines are in the message.
    """
    from concurrent.futures import ThreadPoolExecutor

    with _written(files) as (cc, place):
        include = (f"-I{headers()}",)
        flags = ROWS_FLAGS if len(files["rows.c"]) <= LONG_ROWS else ("-O0",)
        parts = (
            [*_command(cc), *COMMON_FLAGS, *flags, "-c", "rows.c", "-o", "rows.o"],
            [
                *_command(cc),
                *COMMON_FLAGS,
                *TICK_FLAGS,
                *include,
                "-c",
                "converge.c" if search else "library.c",
                "-o",
                "tick.o",
            ],
        )
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(lambda part: _run(part, place), parts))
        _run([*_command(cc), "rows.o", "tick.o", *_with_solver(cc, output, files, place)], place)


def compile_rows(text: str, output: pathlib.Path) -> None:
    """Compile generated straight-line code to a shared library at ``output``.

    Raises:
        CompileError: as of :func:`compile_tick`.
    """
    flags = ROWS_FLAGS if len(text) <= LONG_ROWS else ("-O0",)
    _compile_visible({"rows.c": text}, output, flags, None)


def compile_kernel(files: Mapping[str, str], output: pathlib.Path, target: TargetMachine | None = None) -> None:
    """Compile hand-written files, of which the first includes the others, to a shared library at ``output``.

    ``target``: for any processor of its kind; default: for this machine's only.

    Raises:
        CompileError: as of :func:`compile_tick`.
    """
    _compile_visible(files, output, ("-O3",), target)


def _compile_visible(
    files: Mapping[str, str], output: pathlib.Path, optimisation: tuple[str, ...], target: TargetMachine | None
) -> None:
    with _written(files, target) as (cc, place):
        # What it exports must be seen by who loads the library
        flags = [f for f in _common(target) if not f.startswith(("-fvisibility", "-DCASADI_SYMBOL_EXPORT"))]
        made = _shared(cc, output, files, place, target)
        _run([*_command(cc, target), *flags, *optimisation, next(iter(files)), *made], place)


def compile_generic(files: Mapping[str, str], output: pathlib.Path, target: TargetMachine | None = None) -> None:
    """Compile the files of :func:`wbc.stack.generic.sources`, with DAQP, to a shared library at ``output``.

    ``target``: as of :func:`compile_kernel`.

    Raises:
        CompileError: as of :func:`compile_tick`.
    """
    require(target or HERE)
    with _written(files, target) as (cc, place):
        command = [*_command(cc, target), *_common(target), "-O1", f"-I{headers(target or HERE)}", "generic.c"]
        _run([*command, *_with_solver(cc, output, files, place, target)], place)


def _common(target: TargetMachine | None) -> tuple[str, ...]:
    """Flags of all code for a target. Windows can move any code, and shows of a library what is declared so."""
    windows = (target or HERE).system == "win32"
    left_out = ("-march=native",) * (target is not None) + ("-fPIC",) * windows
    shown = ("-DEXPORT=__declspec(dllexport)",) * windows
    return (*(flag for flag in COMMON_FLAGS if flag not in left_out), *shown)


@contextmanager
def _written(files: Mapping[str, str], target: TargetMachine | None = None) -> Iterator[tuple[str, pathlib.Path]]:
    """The compiler, and a folder that has the files while it is used."""
    import tempfile

    cc = _compiler_for(target or HERE)
    with tempfile.TemporaryDirectory(prefix="wbc-") as folder:
        place = pathlib.Path(folder)
        for name, text in files.items():
            (place / name).write_text(text)
        yield cc, place


def _compiler_for(target: TargetMachine) -> str:
    """The compiler; for other machines zig, which brings headers and linkers for them."""
    cc = compiler()
    if target.triple and not (cc and _is_zig(cc)):
        cc = _on_path("zig") or _wheel()
        if cc is None:
            raise CompileError("compiler", None, f"there is no zig for {target.triple}; pip install wbc[compiler]")
    if cc is None:
        raise CompileError("compiler", None, f"no C compiler found; install gcc or wbc[compiler]; {WITHOUT}")
    return cc


def _with_solver(
    cc: str, output: pathlib.Path, files: Mapping[str, str], place: pathlib.Path, target: TargetMachine | None = None
) -> tuple[str, ...]:
    """What links a shared library with DAQP, of which nothing is seen from outside."""
    # zig's linker knows no such option, and -Bsymbolic is enough; a library of macOS finds its own names without both
    hidden = () if _is_zig(cc) else ("-Wl,--exclude-libs,ALL",)
    inside = (*hidden, "-Wl,-Bsymbolic") if (target or HERE).system == "linux" else ()
    return (*inside, str(library(target or HERE)), *_shared(cc, output, files, place, target))


def _shared(
    cc: str, output: pathlib.Path, files: Mapping[str, str], place: pathlib.Path, target: TargetMachine | None
) -> tuple[str, ...]:
    """What makes a shared library at ``output``. Names of the interpreter that loads it are found then: the linker of
    macOS has to be told so, and that of Windows who has them, in a file in ``place``.
    """
    system = (target or HERE).system
    found: tuple[str, ...] = ()
    if system == "darwin":
        found = ("-Wl,-undefined,dynamic_lookup",)
    names = sorted(
        set(re.findall(r"\b(Py[A-Z]?[A-Za-z]*_\w+)\(|(?:extern PyObject \*)(PyExc_\w+)", "".join(files.values())))
    )
    if system == "win32" and names:
        listed = "".join(f"    {name or f'{data} DATA'}\n" for name, data in names)
        (place / "python3.def").write_text(f"LIBRARY python3.dll\nEXPORTS\n{listed}")
        tool = [cc, "dlltool"] if _is_zig(cc) else ["dlltool"]
        _run([*tool, "-m", "i386:x86-64", "-D", "python3.dll", "-d", "python3.def", "-l", "python3.a"], place)
        found = ("python3.a",)
    return ("-shared", *found, "-lm", "-o", str(output))


def _output(command: list[str]) -> str:
    """What a command prints; nothing where it cannot be started."""
    try:
        return subprocess.run(command, capture_output=True, text=True, errors="replace", check=False).stdout
    except OSError:
        return ""


def _run(command: list[str], folder: pathlib.Path) -> None:
    try:
        child = subprocess.Popen(
            command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace"
        )
    except OSError as error:
        raise CompileError("compiler", command[0], f"cannot be started: {error.strerror}") from error
    with child:
        try:
            _, errors = child.communicate()
        except BaseException:
            child.kill()
            raise
    if child.returncode != 0:
        said = " / ".join(errors.splitlines()[:4]) or f"exit status {child.returncode}, no message"
        raise CompileError("compiler", command[0], f"failed: {said}")
