"""What a viewer does: states in, scene and messages out, drags back to the loop."""

from __future__ import annotations

import contextlib
import itertools
import json
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.api import Controller
from wbc.controller import core_of
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.tasks.base import Constraint
from wbc.validation import Array
from wbc.viewer import messages
from wbc.viewer.aside import CoreLeft
from wbc.viewer.drawing import DEMANDED, Drawing, hand_of, look
from wbc.viewer.errors import ViewerError
from wbc.viewer.link import STOPPED, UNHEARD, UNHEARD_TEXT, WAITS, SharedTick, ViewerEnd
from wbc.viewer.operation import Operation
from wbc.viewer.pairing import Pairing, PairWatch
from wbc.viewer.reading import declared, sentences, told
from wbc.viewer.scenery import Scenery, checked
from wbc.viewer.self_motion import self_motion
from wbc.viewer.server import SILENT, PageServer
from wbc.viewer.tick import Tick
from wbc.viewer.timeline import Timeline
from wbc.viewer.ways import WaysRound

#: States that are drawn and told a second, at most [1/s]
RATE = 40.0
#: Explanations that are told a second, at most [1/s]
EXPLAINED = 25.0
#: More pages than this share what they cost together, as viser writes the scene for each of them anew
SHARED = 3
#: States a second that every page has at least [1/s]
SLOWEST = 20.0
#: What a page can ask to be drawn
SELF_MOTION = "self-motion"
DRAWN = (*DEMANDED, SELF_MOTION)
#: Between two signs of life for the loop [s]
LOOP_BEAT = 0.05
#: Signs of life between two looks where the loop runs
EXPLAINED_TRIES = 10


class LiveExplainer(threading.Thread):
    """Explains the newest tick that it is given, one after the other."""

    def __init__(self) -> None:
        super().__init__(name="explainer", daemon=True)
        self._wanted: Tick | None = None
        self._wake, self.count = threading.Event(), 0
        #: number of the tick that was explained last, and what was said
        self.said: tuple[int, list[str]] = (0, [])

    def ask(self, tick: Tick) -> None:
        """Explain this next, if nothing newer comes before."""
        self._wanted = tick
        self._wake.set()

    def run(self) -> None:
        last = b""
        while True:
            self._wake.wait()
            self._wake.clear()
            tick, began = self._wanted, time.monotonic()
            if tick is None:
                return
            if tick.state.data != last:
                try:
                    self.said = tick.number, sentences(tick.step.explain())
                except WbcError as error:
                    self.said = tick.number, [str(error)]
                last = tick.state.data
            self.count += 1
            took = time.monotonic() - began
            # The rest of the process has a fifth of its core at the least
            time.sleep(max(1.0 / EXPLAINED - took, 0.25 * took))

    def end(self) -> None:
        """Stop after the explanation that is under way."""
        self._wanted = None
        self._wake.set()


class Session:
    """One viewer: a server, its scene, and where states come from.

    Args:
        controller: compiled from the same stack as the loop's; only its names, layout and code are used.
        link: to the loop; None: ``states`` of a recording. core: of the loop, which is left to it.
    """

    def __init__(
        self,
        controller: Controller,
        link: ViewerEnd | None,
        states: Sequence[SharedTick] = (),
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        silence: float = SILENT,
        scenery: Scenery | None = None,
        pairing: Pairing | None = None,
        core: CoreLeft | None = None,
    ) -> None:
        self._core = core
        self._scenery, self._pairing = scenery, pairing
        self._pairs = None if pairing is None else PairWatch(controller.stack.robot, pairing)
        self._controller, self._link = controller, link
        self._checker = Operation(controller)
        self._tick: Tick | None = None
        self._sending = threading.Lock()
        self.timeline = Timeline(states)
        self.ended = threading.Event()
        self._stopped, self._drawn = "", False
        #: what the loop said beside its ticks last, and its number
        self._note: dict[str, Any] = {}
        self._noted = 0
        #: configurations that are shown in place of the robot's own
        self._preview: list[Array] = []
        told_first = declared(controller) | {"live": link is not None, "silence": silence, "walk": scenery is not None}
        if scenery is not None:
            told_first["arms"] = scenery.arms
        if pairing is not None:
            told_first |= pairing.declared()
        self.server = PageServer(host, port, token, told_first, self._obey, silence)
        self.server.on_lost(self._operator_lost)
        # The scene after the address: a page that comes early waits for it
        dragged = None if link is None or scenery is not None or pairing is not None else self._dragged
        self._drawing = Drawing(self.server.scene, controller, dragged, scenery=scenery, picked=self._picked)
        self._explainer = LiveExplainer()
        self._ways = None if dragged is None else WaysRound(controller, self._send, self._refused)
        if link is not None:
            # A page may operate before the first of the regular signs; the loop would take it for lost
            link.live()

    @property
    def url(self) -> str:
        """Address of the page."""
        return self.server.url

    def run(self) -> None:
        """Until :attr:`ended` is set."""
        sys.setswitchinterval(0.001)
        threading.Thread(target=self._beat, name="signs of life", daemon=True).start()
        self._explainer.start()
        before, shown, counted = time.monotonic(), b"", (time.monotonic(), 0)
        sentence_rate, quiet = 0.0, 0.0
        while not self.ended.is_set():
            now = time.monotonic()
            self.timeline.advance(now - before)
            before = now
            if self._link is not None and (state := self._link.read(self._newest())) is not None:
                self._last = state
                self.timeline.add(state)
            current = self._current()
            if now - counted[0] > 1.0:
                sentence_rate = (self._explainer.count - counted[1]) / (now - counted[0])
                counted = now, self._explainer.count
            # What did not change is told twice a second, for who comes late
            fresh = current is not None and (current.data != shown or now - quiet > 0.5 or bool(self._preview))
            if current is not None and fresh:
                shown, quiet = current.data, now
                self._show(current, sentence_rate)
            rate = max(SLOWEST, RATE * min(1.0, SHARED / max(self.server.watchers, 1)))
            time.sleep(max(0.002, 1.0 / rate - (time.monotonic() - now)))
        self._explainer.end()
        self.server.tell_all({"type": "ended", "reason": "The loop has ended."})
        time.sleep(0.2)
        self.server.close()

    _last: SharedTick | None = None

    def _newest(self) -> int:
        return 0 if self._last is None else self._last.number

    def _current(self) -> SharedTick | None:
        return self._last if self.timeline.live else self.timeline.state()

    def _show(self, state: SharedTick, sentence_rate: float) -> None:
        tick = Tick(self._controller, state)
        if self._tick is None:
            look(self.server.server, self._controller, tick, self._scenery)
        self._tick = tick
        if self._ways is not None and self._link is not None and not self._link.flags & STOPPED:
            self._ways.look(tick)
        if not self.server.watchers and self._drawn:
            # Who comes later is told where everything is by the next tick
            return
        self._drawn = True
        if self._link is not None and (said := self._link.noted(self._noted)) is not None:
            self._noted, self._note = said[0], json.loads(said[1])
        with self.server.server.atomic():
            self._drawing.show(self._shown(tick))
            if self._note:
                self._drawing.note(self._note)
        self._drawing.follow(self.server.server, tick)
        # Not in a window of up to a sixtieth of a second
        self.server.server.flush()
        if not self.server.watchers:
            return
        self._explainer.ask(tick)
        stopped = ""
        if self._link is not None and self._link.flags & STOPPED:
            stopped = UNHEARD_TEXT if self._link.flags & UNHEARD else self._stopped or "by the loop"
        number, text = self._explainer.said
        extra = {
            "stopped": stopped,
            "sentences": text,
            "explained": number,
            "sentence_rate": sentence_rate,
            "timeline": self.timeline.told(),
            "previewed": bool(self._preview),
            "waits": bool(self._link is not None and self._link.flags & WAITS),
        }
        if self._pairs is not None:
            extra |= self._pairs.told(tick)
        if self._note:
            # The way of a hand is drawn; nobody reads its numbers
            extra["walk"] = {name: value for name, value in self._note.items() if name != "ways"}
        self.server.publish(told(self._controller, tick) | extra)

    def _beat(self) -> None:
        """Say that messages are passed on: the server's own thread has to answer in between."""
        for number in itertools.count():
            if self.ended.is_set():
                return
            if self._link is not None and self.server.answers():
                self._link.live()
            if (
                self._link is not None
                and self._core is not None
                and number % EXPLAINED_TRIES == 0
                and self._link.thread
            ):
                self._core.look(self._link.thread)
            time.sleep(LOOP_BEAT)

    # From pages

    def _obey(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "seek":
            self.timeline.seek(validation.scalar("seek.time", message["time"], unit="s"))
        elif kind == "play":
            self.timeline.play(validation.scalar("play.speed", message["speed"], low=0.0, high=100.0))
        elif kind == "live":
            self.timeline.back()
        elif kind == "show":
            self._draw(
                validation.one_of("show.what", message["what"], DRAWN), validation.flag("show.on", message["on"])
            )
        else:
            if kind == "stop":
                self._stopped = str(message.get("reason", "by hand"))
            self._send(message)

    def _draw(self, what: str, on: bool) -> None:
        """What is drawn on demand."""
        tick = self._tick
        if what != SELF_MOTION:
            self._drawing.demand(what, on)
            return
        self._preview = []
        if on and tick is not None:
            frame, rows = hand_of(self._controller)
            self._preview = self_motion(tick.robot, frame, tick.q, rows) if frame else []
            if not self._preview:
                raise ViewerError("show", what, "no joint can move while the hand stays")

    def _shown(self, tick: Tick) -> Tick:
        """The tick, or instead of it the next picture of a self-motion."""
        if not self._preview:
            return tick
        numbers = np.frombuffer(tick.state.data).copy()
        numbers[core_of(self._controller).context.memory["q"]] = self._preview.pop(0)
        return Tick(self._controller, tick.state._replace(data=numbers.tobytes()))

    def _send(self, message: dict[str, Any]) -> None:
        """On to the loop."""
        if self._link is None:
            raise ViewerError(message["type"], "recording", "a recording obeys nobody")
        if self._scenery is not None:
            checked(message, self._scenery.holds, self._scenery.arms)
        elif self._pairing is not None:
            self._pairing.checked(message)
        else:
            self._checker.check(message)
        if message["type"] in ("set", "rate") and self._link.flags & STOPPED:
            block = core_of(self._controller).layout.blocks[message["item"]]
            if not isinstance(block.entry.item, Constraint):
                raise ViewerError("message", message["item"], "the robot is stopped; resume first")
        if message["type"] in ("set", "rate") and not self.timeline.live:
            raise ViewerError("message", message["item"], "the past cannot be changed; go back to live")
        with self._sending:
            if not self._link.send(messages.write(message).encode()):
                raise ViewerError("message", message["type"], "the loop takes no messages; is it still running?")
        if self._ways is not None and message["type"] == "set" and "target" in message["values"]:
            self._ways.dragged(message["item"])

    def _dragged(self, item: str, value: str, pose: pin.SE3, phase: str, client: int | None) -> None:
        """A gizmo was moved in the scene by one of viser's clients."""
        tick = self._tick
        if tick is None or phase == "start" or not self.server.operates(client):
            return
        local = tick.reference(item).actInv(pose)
        slot = core_of(self._controller).layout.blocks[item].slots[value]
        sent: list[float] = [float(x) for x in pin.SE3ToXYZQUAT(local)]
        sent = sent if slot.input.kind == "pose" else sent[:3]
        try:
            self._send({"type": "set", "item": item, "values": {value: sent}})
        except WbcError as error:
            if phase == "end":
                self._refused(str(error))

    def _refused(self, reason: str) -> None:
        self.server.tell_all({"type": "refused", "reason": reason})

    def _picked(self, hold: str, client: int | None) -> None:
        """A hold was clicked by one of viser's clients."""
        if self.server.operates(client):
            try:
                self._send({"type": "go", "hold": hold})
                self._drawing.mark_goal(hold)
            except WbcError as error:
                self._refused(str(error))

    def _operator_lost(self) -> None:
        self._drawing.let_go()
        self._stopped = "the operator's page was lost"
        for kind in ({"type": "stop", "reason": self._stopped}, {"type": "release"}):
            with contextlib.suppress(WbcError):
                self._send(kind)
