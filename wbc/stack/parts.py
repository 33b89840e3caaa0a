"""Items within items."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from wbc.tasks.base import Item


def inner_items(item: Item) -> Iterator[Item]:
    """An item and the items that it is made from."""
    yield item
    for field in dataclasses.fields(item):
        value = getattr(item, field.name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Item):
                yield from inner_items(part)
