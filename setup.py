"""A wheel that has libraries in it (``make wheel``) is of one platform; all else is in pyproject.toml."""

from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel


class WithLibraries(Distribution):
    """A package of one platform where the libraries are there."""

    def has_ext_modules(self) -> bool:
        return any(Path(__file__).parent.glob("wbc/stack/prebuilt_libraries/*.so"))


class AnyPython(bdist_wheel):
    """The libraries know nothing of Python, so the wheel is for all its versions."""

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", super().get_tag()[2]


setup(distclass=WithLibraries, cmdclass={"bdist_wheel": AnyPython})
