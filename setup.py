"""A wheel that has libraries in it (``make wheel``) is of one platform; all else is in pyproject.toml."""

from pathlib import Path

from setuptools import Distribution, setup


class WithLibraries(Distribution):
    """A package of one platform where the libraries are there."""

    def has_ext_modules(self) -> bool:
        return any(Path(__file__).parent.glob("wbc/stack/prebuilt_libraries/*.so"))


setup(distclass=WithLibraries)
