"""Pages of a viewer in a process of their own: ``python -m bench.watchers URL COUNT``; they read until it ends.

Each has both sockets of a page, that of states and that of viser's scene, and draws nothing. They yield to everybody,
as pages are drawn on other machines than the loop's.
"""

from __future__ import annotations

import asyncio
import os
import sys

import viser
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol


async def read(socket: ClientConnection) -> None:
    """Take what comes and forget it."""
    async for _ in socket:
        pass


async def watch(url: str, name: str) -> None:
    """One page; ``url`` is that of its socket of states."""
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    scene = url.removesuffix("wbc") + f"scene/{name}"
    async with (
        connect(f"{url}/{name}", max_size=None, compression=None) as states,
        connect(scene, subprotocols=[protocol], max_size=None, compression=None) as drawn,
    ):
        await asyncio.gather(read(states), read(drawn))


async def main() -> None:
    """All of them at once."""
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    pages = (watch(sys.argv[1], f"watcher{k}") for k in range(int(sys.argv[2])))
    await asyncio.gather(*pages, return_exceptions=True)


if __name__ == "__main__":
    asyncio.run(main())
