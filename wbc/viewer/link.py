"""The memory that a control loop and its viewer share: states of ticks one way, messages the other.

The loop never waits: it copies a tick's state (2 kB of an arm, 30 kB of a humanoid) into the next of some slots and
then counts it. The viewer copies the newest slot and keeps the copy only if the loop has not come round meanwhile.
Messages of the viewer (:mod:`wbc.viewer.messages`) lie in a ring behind two counters, one that each side writes.

    words    0 states written   1 bytes of messages written   2 bytes of messages read   3 flags of the loop
             5 the loop's thread, as the kernel numbers it   6 notes begun and ended, odd while one is written
    numbers  4 the viewer's last sign of life   [s of the machine's monotonic clock]
    ring     RING bytes of messages: a length of 4 bytes, then JSON
    note     NOTE bytes: a length, then JSON: what the loop says of itself beside its ticks, seldom
    slots    SLOTS times: number of the state, its time [s], the number again, then the state

All of it is anonymous memory of Linux (``memfd_create``), which goes when the last process that has it does.
"""

from __future__ import annotations

import mmap
import os
import struct
import tempfile
import threading
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

#: Bytes of the head
HEAD = 64
#: Bytes of the ring of states
RING = 1 << 16
#: Bytes of a note
NOTE = 1 << 14
#: Slots of the ring
SLOTS = 4
#: Words of the head, and of a slot's
STATES = 0
SENT = 1
TAKEN = 2
FLAGS = 3
VIEWER_ALIVE = 4
THREAD = 5
NOTES = 6
SLOT_HEAD = 24
#: Flag of the loop: it brakes on a stop
STOPPED = 1
#: Flag of the loop: it brakes because the viewer was silent
UNHEARD = 2
#: A hand is lifted when the operator says yes
WAITS = 4
UNHEARD_TEXT = "the viewer gave no sign of life"
_LENGTH = struct.Struct("<I")
#: Number of a state, and its time
_STAMP = struct.Struct("<qd")


class SharedTick(NamedTuple):
    """A tick: its number from 1, its time on the loop's clock [s], its memory."""

    number: int
    time: float
    data: bytes


def size_for(state: int) -> int:
    """Bytes of the memory for states of so many bytes."""
    return HEAD + RING + NOTE + SLOTS * (SLOT_HEAD + state)


class _Shared:
    def __init__(self, file: int, state: int) -> None:
        self.file, self.state = file, state
        self._map = mmap.mmap(file, size_for(state))
        self._bytes = memoryview(self._map)
        self._words = self._bytes[:HEAD].cast("q")
        self._numbers = self._bytes[:HEAD].cast("d")
        self._ring = self._bytes[HEAD : HEAD + RING]
        self._note = self._bytes[HEAD + RING : HEAD + RING + NOTE]
        first, step = HEAD + RING + NOTE, SLOT_HEAD + state
        self._slots = [self._bytes[first + k * step : first + (k + 1) * step] for k in range(SLOTS)]

    def close(self) -> None:
        """Let the memory go; more calls do nothing."""
        if self.file >= 0:
            views: list[memoryview[Any]] = [
                *self._slots,
                self._note,
                self._ring,
                self._numbers,
                self._words,
                self._bytes,
            ]
            for view in views:
                view.release()
            self._map.close()
            os.close(self.file)
            self.file = -1


def _unnamed_file() -> int:
    """A file that nothing but its descriptor leads to."""
    made = getattr(os, "memfd_create", None)  # of Linux
    if made is not None:
        return int(made("wbc-viewer"))
    file, name = tempfile.mkstemp(prefix="wbc-viewer-")
    os.unlink(name)
    return file


class LoopEnd(_Shared):
    """The control loop's end; makes the memory.

    Args:
        state: bytes of a tick's state.
    """

    def __init__(self, state: int) -> None:
        file = _unnamed_file()
        os.ftruncate(file, size_for(state))
        super().__init__(file, state)
        self._count = 0

    def write(self, data: bytes, when: float) -> None:
        """The state of a tick."""
        number = self._count = self._count + 1
        if number == 1:
            self._words[THREAD] = threading.get_native_id()
        slot = self._slots[number % SLOTS]
        _STAMP.pack_into(slot, 0, number, when)
        slot[SLOT_HEAD:] = data
        slot[16:SLOT_HEAD] = slot[:8]
        self._words[STATES] = number

    @property
    def waiting(self) -> bool:
        """Messages have come."""
        return self._words[SENT] != self._words[TAKEN]

    def take(self) -> Iterator[bytes]:
        """The messages that have come, oldest first."""
        while (taken := self._words[TAKEN]) != self._words[SENT]:
            (length,) = _LENGTH.unpack(self._part(taken, _LENGTH.size))
            content = self._part(taken + _LENGTH.size, length)
            self._words[TAKEN] = taken + _LENGTH.size + length
            yield content

    def _part(self, start: int, length: int) -> bytes:
        start %= RING
        first = bytes(self._ring[start : start + length])
        return first + bytes(self._ring[: length - len(first)])

    @property
    def silence(self) -> float:
        """Since the viewer's last sign of life [s]."""
        return time.monotonic() - float(self._numbers[VIEWER_ALIVE])

    def put_flags(self, flags: int) -> None:
        """What the viewer is to know of the loop."""
        self._words[FLAGS] = flags

    def note(self, text: bytes) -> bool:
        """Say something of the loop beside its ticks; False where it is too long and the last one stays."""
        if len(text) > NOTE - _LENGTH.size:
            return False
        self._words[NOTES] += 1
        _LENGTH.pack_into(self._note, 0, len(text))
        self._note[_LENGTH.size : _LENGTH.size + len(text)] = text
        self._words[NOTES] += 1
        return True


class ViewerEnd(_Shared):
    """The viewer's end, from the number of the file that it inherits. One thread may send, one may read."""

    def send(self, message: bytes) -> bool:
        """A message for the loop; False where the loop has not taken the last ones and there is no place for it."""
        sent, needed = self._words[SENT], _LENGTH.size + len(message)
        if sent - self._words[TAKEN] + needed > RING:
            return False
        for k, part in ((sent, _LENGTH.pack(len(message))), (sent + _LENGTH.size, message)):
            start = k % RING
            room = min(len(part), RING - start)
            self._ring[start : start + room] = part[:room]
            self._ring[: len(part) - room] = part[room:]
        self._words[SENT] = sent + needed
        return True

    def read(self, after: int = 0) -> SharedTick | None:
        """The newest state, None where it is not newer than number ``after``."""
        for _ in range(8):
            number = self._words[STATES]
            if number <= after:
                return None
            slot = bytes(self._slots[number % SLOTS])
            begun, when = _STAMP.unpack_from(slot)
            # The loop may have come round while this was copied
            if begun == number and slot[16:SLOT_HEAD] == slot[:8] and self._words[STATES] < number + SLOTS - 1:
                return SharedTick(number, when, slot[SLOT_HEAD:])
        return None

    def live(self) -> None:
        """Give a sign of life."""
        self._numbers[VIEWER_ALIVE] = time.monotonic()

    @property
    def flags(self) -> int:
        """What the loop says of itself."""
        return int(self._words[FLAGS])

    def noted(self, after: int) -> tuple[int, bytes] | None:
        """(number, text) of the loop's note, None where it is number ``after`` or just being written."""
        number = self._words[NOTES]
        if number == after or number % 2:
            return None
        (length,) = _LENGTH.unpack_from(self._note)
        text = bytes(self._note[_LENGTH.size : _LENGTH.size + min(length, NOTE)])
        return (number, text) if self._words[NOTES] == number else None

    @property
    def thread(self) -> int:
        """The loop's thread as the kernel numbers it, 0 before its first state."""
        return int(self._words[THREAD])
