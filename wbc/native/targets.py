"""Kinds of machines that hand-written C is compiled for ahead: this one, and others that zig compiles for from here."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import casadi as ca

from wbc import validation
from wbc.errors import CompileError
from wbc.quick_dataclasses import dataclass

#: Name of a shared library's file ends so
_SUFFIXES = {"darwin": ".dylib", "win32": ".dll"}


@dataclass(frozen=True)
class TargetMachine:
    """A kind of machine.

    Attributes:
        system: ``sys.platform`` there.
        machine: ``platform.machine()`` there.
        triple: zig's name of it; empty: this machine.
        tag: of wheels that run there.
        casadi: folder of the casadi package for it, which has the solver.
    """

    system: str
    machine: str
    triple: str = ""
    tag: str = ""
    casadi: Path = Path(ca.__file__).parent

    @property
    def suffix(self) -> str:
        """How names of its shared libraries end."""
        return _SUFFIXES.get(self.system, ".so")


#: This machine, and others with any processor of its kind
HERE = TargetMachine(sys.platform, platform.machine())
#: Those that zig compiles for
OTHERS = {
    "linux-aarch64": TargetMachine("linux", "aarch64", "aarch64-linux-gnu.2.17", "manylinux2014_aarch64"),
    "macos-arm64": TargetMachine("darwin", "arm64", "aarch64-macos.11.0", "macosx_11_0_arm64"),
    "windows-x86-64": TargetMachine("win32", "AMD64", "x86_64-windows-gnu", "win_amd64"),
}


def with_solver(name: str, folder: Path) -> TargetMachine:
    """One of :data:`OTHERS` with the solver for it, which pip takes (60 MB) from the casadi wheel of that machine.

    Args:
        folder: of what is downloaded; what is there already is used.

    Raises:
        UnknownNameError: there is no such target. CompileError: the wheel cannot be had, or has no static DAQP.
    """
    import zipfile

    found = OTHERS[validation.one_of("platform", name, OTHERS)]
    version = str(ca.CasadiMeta.version())
    options = ("--no-deps", "--only-binary=:all:", "--platform", found.tag, "--python-version", "3.11")
    command = (sys.executable, "-m", "pip", "download", "-q", *options, f"casadi=={version}", "-d", folder)
    wheels = f"casadi-{version}-*{found.tag}.whl"
    if not any(folder.glob(wheels)):
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
        if done.returncode:
            said = (done.stderr.splitlines() or ["no message"])[-1]
            raise CompileError("solver", f"casadi {version} for {found.tag}", f"pip cannot download it: {said}")
    with zipfile.ZipFile(next(folder.glob(wheels))) as wheel:
        named = [name for name in wheel.namelist() if name.startswith("casadi/include/daqp/")]
        if "casadi/libdaqpstat.a" not in wheel.namelist():
            raise CompileError("solver", wheel.filename, "has no static DAQP, casadi/libdaqpstat.a")
        wheel.extractall(folder / name, ["casadi/libdaqpstat.a", *named])
    return TargetMachine(found.system, found.machine, found.triple, found.tag, folder / name / "casadi")
