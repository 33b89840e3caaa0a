"""What happens where ticks cannot be compiled: three stacks, two of them alike but for a weight, and what was said."""

from __future__ import annotations

import json
import logging
from typing import Any


class Kept(logging.Handler):
    """Every log record, as (name, level, message)."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[list[str]] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append([record.name, record.levelname, record.getMessage()])


def found() -> dict[str, Any]:
    """Back ends, commands, log records, and why a native tick was refused."""
    kept = Kept()
    logging.getLogger().addHandler(kept)
    try:
        import wbc

        imported = list(kept.records)
        from tests.stack import small

        made = [small.stack().compile(), small.stack(gain=3.0).compile(), small.stack(small.arm(length=0.6)).compile()]
        small.command(made[1])
        try:
            small.stack().compile(backend="native")
            refused = None
        except wbc.errors.CompileError as error:
            refused = [error.field, str(error)]
        return {
            "imported": imported,
            "records": kept.records,
            "backends": [c.backend for c in made],
            "commands": [small.command(made[0]), small.command(made[2])],
            "refused": refused,
        }
    finally:
        logging.getLogger().removeHandler(kept)


if __name__ == "__main__":
    print(json.dumps(found()))
