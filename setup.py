"""What pyproject.toml cannot say: hand-written C is compiled ahead, into the clone or the wheel; wbc/stack/ahead.py.

With WBC_WHEEL_PLATFORM, a name of wbc.native.targets.OTHERS, the wheel is for that kind of machine.
"""

import os
import shutil
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

HERE = Path(__file__).parent
PLATFORM = os.environ.get("WBC_WHEEL_PLATFORM")


def compile_ahead() -> None:
    """Compile into wbc/native/ahead. Where that cannot be, a sentence says what follows."""
    sys.path.insert(0, str(HERE))
    try:
        from wbc.errors import CompileError
        from wbc.stack import ahead
    except ModuleNotFoundError as error:
        print(f"wbc: {error.name} is not there yet, so C is compiled when it is first used", file=sys.stderr)
        return
    try:
        ahead.build()
    except CompileError as error:
        print(f"wbc: nothing was compiled, so stacks need a C compiler where they are used: {error}", file=sys.stderr)


class WithLibraries(Distribution):
    """A package of one platform where the libraries are there."""

    def has_ext_modules(self) -> bool:
        return bool(PLATFORM) or any(HERE.glob("wbc/native/ahead/*"))


class Compiled(build_py):
    """Libraries are package data, so they are made before those are listed."""

    def finalize_options(self) -> None:
        compile_ahead()
        super().finalize_options()

    def run(self) -> None:
        super().run()
        if PLATFORM:
            from wbc.native import targets
            from wbc.stack import ahead

            folder = Path(self.build_lib).resolve() / "wbc" / "native" / "ahead"
            shutil.rmtree(folder, ignore_errors=True)
            ahead.build(targets.with_solver(PLATFORM, HERE / "build" / "solver"), folder)


class AnyPython(bdist_wheel):
    """The libraries know nothing of Python, so the wheel is for all its versions."""

    def finalize_options(self) -> None:
        # Only now is it known whether the wheel is of one platform
        self.get_finalized_command("build_py")
        super().finalize_options()

    def get_tag(self) -> tuple[str, str, str]:
        if not PLATFORM:
            return "py3", "none", super().get_tag()[2]
        from wbc.native import targets

        return "py3", "none", targets.OTHERS[PLATFORM].tag


setup(distclass=WithLibraries, cmdclass={"bdist_wheel": AnyPython, "build_py": Compiled})
