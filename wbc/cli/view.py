"""``wbc view``: robots and runs in the browser."""

from __future__ import annotations

import contextlib
import os
import threading
import webbrowser
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from wbc.cli import console
from wbc.cli.reading import Option
from wbc.cli.replay import Trust
from wbc.cli.scene import Backend
from wbc.climb.request import ClimberRequest, SceneRequest
from wbc.errors import UnknownNameError, nearest

if TYPE_CHECKING:
    from wbc.robot import Robot
    from wbc.viewer import Viewer


@dataclass(frozen=True)
class PageOptions:
    """Where a page is served, and until when."""

    PANEL: ClassVar[str] = "The page"
    host: Annotated[str, "Address; one that other machines reach needs the token that is printed."] = "127.0.0.1"
    port: Annotated[int, "0: any that is free."] = 0
    browser: Annotated[bool, "Open the page in the browser."] = True
    seconds: Annotated[float | None, "End after so long [s]. Default: Ctrl-C."] = None

    def options(self) -> dict[str, Any]:
        """As :func:`wbc.viewer.run` takes them."""

        def announce(viewer: Viewer) -> None:
            show(viewer.url)

        return {"host": self.host, "port": self.port, "open_browser": self.browser, "announce": announce}


@dataclass(frozen=True)
class Driven(PageOptions, ABC):
    """A page on which a robot is driven."""

    zeromq: Annotated[str, "Take messages over ZeroMQ, too, at an address such as tcp://127.0.0.1:5555."] = ""
    silence: Annotated[float, "The robot stops where the page or the viewer gives no sign of life for so long [s]."] = (
        10.0
    )
    backend: Backend = "auto"

    def run(self) -> None:
        from wbc import extras
        from wbc.viewer.errors import require_local

        extras.require("viewer", "a page in the browser")
        if self.zeromq:
            require_local(self.zeromq)
        with until_interrupted():
            self.drive(self.options() | {"zeromq": self.zeromq, "silence": self.silence})

    @abstractmethod
    def drive(self, options: dict[str, Any]) -> None:
        """What is driven, with the options of :func:`wbc.viewer.run`."""


@dataclass(frozen=True)
class Play(Driven):
    """Drag a robot's targets and the obstacles, and read what holds it back."""

    preset: Annotated[str, Option("panda, dual-arm, talos, g1, mobile, walker or ssrms.", placed=True)] = "panda"

    def drive(self, options: dict[str, Any]) -> None:
        from wbc.viewer import run
        from wbc.viewer.presets import playground

        chosen = playground(self.preset)
        about(chosen.about)
        with console.err().status(f"compiling the stack of {chosen.stack.robot.name}; it is kept for the next time"):
            controller = chosen.stack.compile(backend=self.backend)
        run(controller, chosen.start, self.seconds, **options)


@dataclass(frozen=True)
class ViewPairs(Driven):
    """Drive an arm by pairs of coordinates, with sliders."""

    robot: Annotated[str, Option("ssrms, spdm, or any arm by name or file.", placed=True)] = "ssrms"

    def drive(self, options: dict[str, Any]) -> None:
        from wbc.viewer.operating import operate

        about("Choose a pair, and drive what it commands by its sliders.")
        operate(self.robot, self.seconds, backend=self.backend, **options)


#: The published walker, on which it is shown where nothing else is said
WALKER = ClimberRequest()
#: Its cylinder
CYLINDER = SceneRequest()


@dataclass(frozen=True)
class ViewWalk(Driven):
    """Steer a climber on a scene."""

    climber: Annotated[ClimberRequest, "What climbs"] = WALKER
    scene: Annotated[SceneRequest, "On what"] = CYLINDER
    place: Annotated[str, "Over which it stands at first, such as 13,6 on a grid, or a foothold's id."] = ""

    def drive(self, options: dict[str, Any]) -> None:
        from wbc.viewer.climbing import climb, standing

        with console.err().status("the first stance"):
            stood = standing(self.climber, self.scene, self.place)
        about("Steer with W S A D and Q E or the stick, or click a foothold.")
        climb(*stood, self.seconds, backend=self.backend, **options)


@dataclass(frozen=True)
class ViewShow(PageOptions):
    """Show a robot with its joints on sliders, or a run with its time on one."""

    what: Annotated[
        str, Option("A name of `wbc robots`, a URDF or MJCF file, a run folder, or a recording.", placed=True)
    ] = "panda"
    export: Annotated[Path | None, "Of a run: write one HTML file that plays offline, and end."] = None
    trust: Trust = False

    def run(self) -> None:
        from wbc import extras, validation
        from wbc.viewer.errors import ViewerError
        from wbc.viewer.runs import REPLAY, recording_in

        extras.require("viewer", "a page in the browser")
        path = Path(self.what)
        if not validation.exists("what", self.what) and (path.name != self.what or path.suffix):
            raise ViewerError("what", self.what, validation.no_such(self.what, "there is no such file or folder"))
        recording = recording_in(path) if path.is_dir() or path.suffix == ".npz" else None
        if recording is not None:
            self._recording(recording)
        elif path.is_dir():
            if not (path / REPLAY).is_file():
                raise ViewerError("run", self.what, f"holds neither a recording nor {REPLAY}")
            self._open((path / REPLAY).resolve().as_uri())
        else:
            self._robot()

    def _open(self, url: str) -> None:
        show(url)
        if self.browser:
            webbrowser.open(url)

    def _robot(self) -> None:
        from wbc.viewer import run
        from wbc.viewer.errors import ViewerError
        from wbc.viewer.presets import of_robot

        robot = named(self.what)
        if self.export is not None:
            raise ViewerError("export", self.what, "only runs are exported; this is a robot")
        chosen = of_robot(robot)
        console.tell(chosen.about)
        with until_interrupted():
            run(chosen.stack.compile(backend="vm"), chosen.start, self.seconds, **self.options())

    def _recording(self, file: Path) -> None:
        from wbc.record.recording import Recording
        from wbc.viewer.beside import token_for
        from wbc.viewer.runs import save_page, states_of
        from wbc.viewer.session import Session

        with console.err().status("doing the ticks of the recording again"):
            controller, states = states_of(Recording(file), trust=self.trust)
        if self.export is not None:
            console.say(save_page(controller, states, self.export))
            return
        session = Session(controller, None, states, host=self.host, port=self.port, token=token_for(self.host))
        self._open(session.url)
        if self.seconds is not None:
            threading.Timer(self.seconds, session.ended.set).start()
        with until_interrupted():
            session.run()


def named(what: str) -> Robot:
    """The robot of a name or a file; a name that is none may be that of something here."""
    from wbc import robots
    from wbc.viewer.errors import ViewerError

    try:
        return robots.load(what)
    except UnknownNameError as error:
        if error.field != "robot":
            raise
        near = nearest(what, [*error.choices, *os.listdir()])
        reason = f"no robot has this name, and there is no such file or folder; did you mean {near[0]!r}?"
        raise ViewerError("what", what, reason, near) from None


def show(url: str) -> None:
    """An address, plain, so that it can be read by a program."""
    console.say(url)


def about(text: str) -> None:
    """What is seen, and how it ends."""
    console.tell(f"{text} Space stops it, Ctrl-C ends.")


@contextlib.contextmanager
def until_interrupted() -> Iterator[None]:
    """Ctrl-C is how these commands end."""
    with contextlib.suppress(KeyboardInterrupt):
        yield
