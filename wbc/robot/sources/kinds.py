"""What a user handed in, told apart without importing what reads it."""

from __future__ import annotations

from typing import Any

#: Of files that are expanded, or converted, into others
XACRO = ".xacro"
USD = (".usd", ".usda", ".usdc", ".usdz")


def is_mjmodel(source: Any) -> bool:
    """Whether a user handed in a ``mujoco.MjModel``; MuJoCo is not imported for it."""
    kind = type(source)
    return kind.__name__ == "MjModel" and kind.__module__.startswith("mujoco")


def is_text(source: Any) -> bool:
    """Whether a string is XML instead of a name or path."""
    return isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<")
