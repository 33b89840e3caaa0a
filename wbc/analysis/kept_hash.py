"""Hashes of declarations that are computed once: control loops look them up in every tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

_NAME = "_kept_hash"


def keeps_hash(cls: type[T]) -> type[T]:
    """A frozen dataclass whose instances keep their hash; copies in other processes compute their own."""
    compute: Callable[[Any], int] = cls.__hash__

    def kept(self: Any) -> int:
        values: dict[str, Any] = self.__dict__
        found: int | None = values.get(_NAME)
        if found is None:
            # Past the dataclass, which is frozen
            found = values[_NAME] = compute(self)
        return found

    def state(self: Any) -> dict[str, Any]:
        # Hashes of texts differ from process to process
        return {name: value for name, value in self.__dict__.items() if name != _NAME}

    cls.__hash__ = kept  # type: ignore[method-assign]
    cls.__getstate__ = state  # type: ignore[method-assign]
    return cls
