"""Work on a subdivision in pieces: threads, a time limit, a file to go on from."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import astuple
from pathlib import Path
from typing import TypeAlias
from zipfile import BadZipFile

import numpy as np

from wbc import validation
from wbc.analysis.algebra.trig_form import TrigForm
from wbc.analysis.certificates.boxes import BoxSearch, Counts
from wbc.archives import open_npz
from wbc.errors import RobotFileError
from wbc.interrupts import interrupts
from wbc.validation import Array

#: Boxes of one piece
_PIECE = 16
#: Boxes that a piece may become at first before it is handed back
_FEW = 1000
#: The same, at most
_LATER_BUDGET = 20_000
#: Time that a piece should take at most [s]
_TURN = 0.3
#: Time between two saves [s]
_SAVE = 20.0

_Done: TypeAlias = tuple[Counts, Array, Array]


class BoxPieces:
    """Boxes that wait, and what became of the others.

    Attributes:
        counts: of all sittings. kept: some of the undecided boxes. seconds: of all sittings, wall clock.

    Raises:
        RobotFileError: the file is none of these, is of another problem, or cannot be written.
    """

    def __init__(
        self, search: BoxSearch, boxes: Array, path: Path | None, forms: Sequence[TrigForm], eps: float
    ) -> None:
        self.counts, self.kept, self.seconds = Counts(), np.empty((0, boxes.shape[1])), 0.0
        self._search, self._waiting, self._path = search, [boxes], path
        self._budget = _FEW
        self._name = _name(forms, boxes, eps)
        if path is not None and path.exists():
            self._load(path)

    def work(
        self,
        until: float,
        workers: int,
        progress: Callable[[float], None] | None,
        ended: Callable[[], bool] | None = None,
    ) -> bool:
        """Whether nothing is left. Stops at a time of the monotonic clock, if asked or at a keyboard interrupt, and
        saves.
        """
        began, spent = time.monotonic(), self.seconds
        running: dict[Future[_Done], Array] = {}
        saved = began
        stop = False
        asked: list[bool] = []
        # Interrupts are only noted: between two lines of the bookkeeping one would lose boxes
        with interrupts(lambda: asked.append(True)), ThreadPoolExecutor(workers) as pool:
            try:
                while (self._waiting or running) and not stop and not asked:
                    while self._waiting and len(running) < 2 * workers:
                        piece = self._take()
                        running[pool.submit(self._timed, piece)] = piece
                    self._collect(running)
                    now = time.monotonic()
                    self.seconds = spent + now - began
                    stop = now > until or (ended is not None and ended())
                    if now - saved > _SAVE:
                        self._save(list(running.values()))
                        saved = now
                    if progress is not None:
                        progress(self.counts.regular_part + self.counts.tube_part + self.counts.undecided_part)
            except KeyboardInterrupt:
                stop = True
            for future in [one for one in running if one.cancel()]:
                self._waiting.append(running.pop(future))
            while running:
                self._collect(running)
            self.seconds = spent + time.monotonic() - began
            self._save([])
        return not self._waiting

    def _timed(self, piece: Array) -> _Done:
        """Some boxes of a piece, as many as take a fraction of a second."""
        began = time.monotonic()
        done = self._search.run(piece, self._budget)
        took = time.monotonic() - began
        if took > _TURN:
            self._budget = max(1, self._budget // 2)
        elif took < _TURN / 4 and done[0].boxes >= self._budget:
            self._budget = min(2 * self._budget, _LATER_BUDGET)
        return done

    def _take(self) -> Array:
        """The last boxes that wait."""
        last = self._waiting.pop()
        if len(last) > _PIECE:
            self._waiting.append(last[:-_PIECE])
        return last[-_PIECE:]

    def _collect(self, running: dict[Future[_Done], Array]) -> None:
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            counts, left, kept = future.result()
            del running[future]
            self.counts += counts
            if len(left):
                self._waiting.append(left)
            self.kept = np.concatenate((self.kept, kept))[:256]

    def _save(self, running: Sequence[Array]) -> None:
        """What waits and what is being worked on, which a second sitting does again."""
        if self._path is None:
            return
        boxes = np.concatenate([*self._waiting, *running, np.empty((0, self.kept.shape[1]))])
        counts = np.array(astuple(self.counts))
        with validation.replacing("state", self._path, RobotFileError) as fresh, fresh.open("wb") as file:
            np.savez_compressed(file, name=self._name, boxes=boxes, kept=self.kept, counts=counts, seconds=self.seconds)

    def _load(self, path: Path) -> None:
        try:
            with open_npz(path) as data:
                name, boxes, kept = str(data["name"]), data["boxes"], data["kept"]
                counts, seconds = Counts(*map(float, data["counts"])), float(data["seconds"])
        except (OSError, ValueError, KeyError, BadZipFile) as error:
            raise RobotFileError("state", str(path), f"not a state of a subdivision: {error}") from error
        if name != self._name:
            raise RobotFileError("state", str(path), "belongs to another robot, set or tube")
        self._waiting = [boxes] if len(boxes) else []
        self.kept, self.counts, self.seconds = kept, counts, seconds


def _name(forms: Sequence[TrigForm], boxes: Array, eps: float) -> str:
    """Of the problem: what is subdivided, and for which tube."""
    digest = hashlib.sha256()
    for array in (boxes, np.array([eps]), *(a for f in forms for a in (f.waves, f.cosine, f.sine))):
        digest.update(np.ascontiguousarray(array, dtype=float).tobytes())
    return digest.hexdigest()
