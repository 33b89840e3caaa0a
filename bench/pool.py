"""Worker processes: started, asked, ended. Workers stay alive and wait on their standard input between rounds."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

ROOT = Path(__file__).parents[1]


def user_environment() -> dict[str, str]:
    """The environment, without what would keep Python from using compiled bytecode as it does for users."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


class WorkerError(RuntimeError):
    """A worker that died; the message holds the end of what it wrote to standard error."""


class Worker:
    """One process with one package on one problem, see ``bench.worker``, or another module that serves as that does."""

    def __init__(
        self, python: str, contender: str, folder: Path, core: int | None, module: str = "bench.worker"
    ) -> None:
        """Start the process; :attr:`ready` is what it said when it had built its problem."""
        self.contender = contender
        self._log: IO[str] = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed with the worker)
        command = [python, "-m", module, contender, str(folder)] + ([str(core)] if core is not None else [])
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            cwd=ROOT,
            env={**user_environment(), "PYTHONPATH": str(ROOT)},
        )
        self.ready = self._read()

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Send one command and wait for its answer.

        Raises:
            WorkerError: the process died.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            self._fail()
        return self._read()

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=30)
        self._log.close()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._fail()
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _fail(self) -> None:
        code = self._process.wait(timeout=30)
        self._log.seek(0)
        raise WorkerError(f"{self.contender} ended with {code}:\n{self._log.read()[-2000:]}")


def cores() -> tuple[int | None, str]:
    """The core that workers are pinned to, and what was done, in words."""
    available = sorted(os.sched_getaffinity(0))
    if len(available) < 2:
        return None, "one core, nothing pinned"
    return available[-1], f"workers pinned to core {available[-1]} of {len(available)}, one at a time"


@contextlib.contextmanager
def contest(pythons: Mapping[str, str], folder: Path, module: str = "bench.worker") -> Iterator[dict[str, Worker]]:
    """A worker for each contender on the problem in a folder, all on one core."""
    core, _ = cores()
    with contextlib.ExitStack() as stack:
        yield {
            name: stack.enter_context(Worker(python, name, folder, core, module)) for name, python in pythons.items()
        }


def turns(names: Sequence[str], rounds: int) -> Iterator[tuple[int, str]]:
    """(round, name) so that each begins a round in turn, and a drift of the machine hits all alike."""
    for k in range(rounds):
        first = k % len(names)
        yield from ((k, name) for name in [*names[first:], *names[:first]])
