"""Locks of open files between processes, on Windows too; a process that dies lets go."""

from __future__ import annotations

import sys
from typing import IO, Any

if sys.platform == "win32":
    import msvcrt

    def lock(file: IO[Any], *, wait: bool = True) -> None:
        """Take the lock; without ``wait`` at once or not at all, with it within ten seconds on Windows.

        Raises:
            OSError: another process has it, or the file system has no locks.
        """
        file.seek(0)
        msvcrt.locking(file.fileno(), msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)

    def unlock(file: IO[Any]) -> None:
        """Let go of the lock.

        Raises:
            OSError: it was not held.
        """
        file.seek(0)
        msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)

else:
    import fcntl

    def lock(file: IO[Any], *, wait: bool = True) -> None:
        """Take the lock; without ``wait`` at once or not at all.

        Raises:
            OSError: another process has it, or the file system has no locks.
        """
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)

    def unlock(file: IO[Any]) -> None:
        """Let go of the lock.

        Raises:
            OSError: the file system has no locks.
        """
        fcntl.flock(file, fcntl.LOCK_UN)
