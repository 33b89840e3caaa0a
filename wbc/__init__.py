"""Whole-body control from declarative tasks."""

from wbc.errors import WbcError

__version__ = "0.1.0"

__all__ = ["WbcError", "__version__"]
