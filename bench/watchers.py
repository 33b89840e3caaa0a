"""Clients of a viewer in a process of their own: ``python -m bench.watchers URL COUNT``; they read until it ends."""

from __future__ import annotations

import asyncio
import sys

from websockets.asyncio.client import connect


async def watch(url: str) -> None:
    """Read states and forget them."""
    async with connect(url, max_size=None) as socket:
        async for _ in socket:
            pass


async def main() -> None:
    """All of them at once."""
    await asyncio.gather(*(watch(sys.argv[1]) for _ in range(int(sys.argv[2]))), return_exceptions=True)


if __name__ == "__main__":
    asyncio.run(main())
