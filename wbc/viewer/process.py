"""The viewer's process: ``python -m wbc.viewer.process``, started by :func:`wbc.viewer.show`.

Its order comes as a pickle through the standard input, which stays open: when the loop's process ends, it ends. The
address goes as one line of JSON to the standard output.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import sys
import threading

from wbc.api import Stack
from wbc.viewer.aside import CoreLeft, step_aside
from wbc.viewer.link import ViewerEnd
from wbc.viewer.session import Session
from wbc.viewer.zeromq import ZeroMqEnd


def main() -> None:
    """Serve until the standard input ends."""
    # Ctrl-C is for the loop, whose end ends this
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    step_aside()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    try:
        order = pickle.load(sys.stdin.buffer)
        stack: Stack = pickle.loads(order["stack"])
        controller = stack.compile(solver=order["solver"], backend=order["backend"])
        link = ViewerEnd(order["file"], order["state"])
        given = {name: order[name] for name in ("host", "port", "token", "silence", "scenery", "pairing")}
        session = Session(controller, link, core=CoreLeft(os.getppid()), **given)
    except Exception as error:
        _say(answers, problem=f"{type(error).__name__}: {error}")
        raise
    if order["zeromq"]:
        try:
            ZeroMqEnd(order["zeromq"], session.url, order["silence"])
        except Exception as error:
            _say(answers, problem=str(error))
            raise
    threading.Thread(target=_wait, args=(session,), daemon=True).start()
    _say(answers, url=session.url)
    session.run()


def _say(answers: object, **what: str) -> None:
    with contextlib.suppress(OSError):
        print(json.dumps(what), file=answers, flush=True)  # type: ignore[call-overload]


def _wait(session: Session) -> None:
    """Until the loop's process, or its viewer, ended."""
    with contextlib.suppress(OSError):
        sys.stdin.buffer.read()
    session.ended.set()


if __name__ == "__main__":
    main()
