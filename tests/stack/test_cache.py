"""The cache of compiled stacks: its key, private and verified entries, parallel builds, unusable folders."""

from __future__ import annotations

import errno
import importlib
import json
import logging
import os
import pathlib
import pwd
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.repeats import ALL, MORE
from tests.stack import small
from wbc.api import Stack
from wbc.native import cache, toolchain
from wbc.shapes import HalfSpace, PlacedShape, Sphere
from wbc.stack import artifact
from wbc.stack.key import key, library_key
from wbc.tasks import Damping, EndEffector, Expression, Hold, JointLimits, Limit, Obstacle, Posture
from wbc.tasks.base import Row, Task

ROOT = pathlib.Path(__file__).parents[2]
Folder = pathlib.Path


@pytest.fixture(autouse=True)
def folder(tmp_path: Folder, monkeypatch: pytest.MonkeyPatch) -> Folder:
    """An empty cache of each test's own, chosen by WBC_CACHE."""
    place = tmp_path / "cache"
    monkeypatch.setenv("WBC_CACHE", str(place))
    return place


def entries(place: Folder) -> list[Folder]:
    """Entries, without locks and unfinished builds."""
    return [p for p in place.iterdir() if not p.name.startswith(".")]


def name_of(stack: Stack, version: str = "1", tools: str = "vm") -> str:
    name = key(stack, version)
    return name if tools == "vm" else library_key(name, tools)


# The key


def with_shape(radius: float) -> Stack:
    robot = small.arm().with_shapes({"link2": [PlacedShape(Sphere(radius), pin.SE3.Identity())]})
    return small.stack(robot).add(Obstacle(HalfSpace()))


def both(make: Callable[[Any], Stack], *values: Any) -> tuple[Callable[[], Stack], Callable[[], Stack]]:
    """Stacks with one value and with another."""
    one, other = values
    return lambda: make(one), lambda: make(other)


@dataclass(frozen=True)
class Reach(Task):
    """A user's task: the first joint at an angle."""

    angle: float = 0.5

    def rows(self, robot: object) -> tuple[Row, ...]:
        return (Row("angle", "rad"),)

    def error(self, robot: object, kin: object, inputs: object) -> ca.SX:
        return kin.q[0] - self.angle


#: What differs -> two stacks whose keys do
DIFFERENT: dict[str, tuple[Callable[[], Stack], Callable[[], Stack]]] = {
    "a length of the robot": (small.stack, lambda: small.stack(small.arm(length=0.6))),
    "a limit of the robot": (small.stack, lambda: small.stack(small.arm(velocity=2.0))),
    "a shape of the robot": (lambda: with_shape(0.1), lambda: with_shape(0.2)),
    "one more item": (small.stack, lambda: small.stack().add(Damping())),
    "a parameter of a task": (small.stack, lambda: small.stack(axes="tip")),
    "a parameter of a constraint": both(
        lambda margin: small.stack().add(JointLimits(margin=margin), name="b"), 0.1, 0.2
    ),
    "a name": both(lambda name: small.stack().add(Posture(), name=name), "b", "c"),
    "the order of items": (
        lambda: small.stack().add(Damping()).add(Posture(), name="b"),
        lambda: small.stack().add(Posture(), name="b").add(Damping()),
    ),
    "a number within a user's expression": (
        lambda: small.stack().add(Expression(lambda kin, p: kin.q[0] - 1.0, units="rad")),
        lambda: small.stack().add(Expression(lambda kin, p: kin.q[0] - 2.0, units="rad")),
    ),
    "a parameter of a user's class": both(lambda angle: small.stack().add(Reach(angle)), 0.1, 0.2),
    "damping": both(lambda damping: Stack(small.arm(), small.DT, damping=damping), 1e-8, 1e-6),
    "characteristic length": both(lambda length: Stack(small.arm(), small.DT, length=length), 1.0, 2.0),
}


@pytest.mark.parametrize("what", DIFFERENT)
def test_key_changes_with(what: str) -> None:
    one, other = DIFFERENT[what]
    assert name_of(one()) == name_of(one())
    assert name_of(one()) != name_of(other())


@pytest.mark.parametrize(
    ("dt", "weight", "gain", "hold"),
    [(0.002, 1.0, 1.0, 1.0), (0.01, 7.0, 1.0, 1.0), (0.01, 1.0, 7.0, 1.0), (0.01, 1.0, 1.0, 7.0)],
)
def test_key_stays_with_time_step_weight_and_gains(dt: float, weight: float, gain: float, hold: float) -> None:
    other = Stack(small.arm(), dt).add(Posture(gain=gain), weight=weight).add(Hold("tip", gain=hold))
    assert name_of(Stack(small.arm(), 0.01).add(Posture()).add(Hold("tip"))) == name_of(other)


def test_key_changes_with_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    def native() -> str:
        toolchain.machine.cache_clear()
        toolchain.identity.cache_clear()
        return name_of(small.stack(), tools=toolchain.identity())

    plain = native()
    assert plain != name_of(small.stack()), "native and virtual machine share no entry"
    for flags in ("ROWS_FLAGS", "TICK_FLAGS", "COMMON_FLAGS"):
        with monkeypatch.context() as patch:
            patch.setattr(toolchain, flags, (*getattr(toolchain, flags), "-g"))
            assert native() != plain
    with monkeypatch.context() as patch:
        patch.setattr(toolchain, "_output", lambda command: "another compiler\n")
        assert native() != plain
    assert native() == plain
    assert name_of(small.stack(), version="2") != name_of(small.stack())


@pytest.mark.parametrize("within", [False, True])
def test_key_changes_with_the_code_of_a_users_class(
    within: bool, tmp_path: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The class and its fields stay the same, only its formula changes: old code would be wrong code; within a limit
    of it, too.
    """
    text = (
        "from dataclasses import dataclass\nfrom wbc.tasks.base import Row, Task\n\n@dataclass(frozen=True)\n"
        "class Mine(Task):\n    def rows(self, robot):\n        return (Row('a', 'rad'),)\n"
        "    def error(self, robot, kin, inputs):\n        return kin.q[0] - 0.25\n"
    )
    file = tmp_path / f"my_tasks_{within}.py"
    file.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    mine = importlib.import_module(file.stem).Mine()
    stack = small.stack().add(Limit(mine, lower=0.0) if within else mine)
    before = name_of(stack)
    assert name_of(stack) == before
    file.write_text(text.replace("0.25", "0.75"))
    assert name_of(stack) != before


# Hits


@pytest.mark.parametrize("backend", ["vm", "native"])
def test_a_hit_builds_no_graph(backend: str, folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    first = small.stack().compile(backend=backend)
    assert not first.cached
    assert first.backend == backend

    def refuse(*arguments: object, **options: object) -> None:
        raise AssertionError("a graph was built")

    monkeypatch.setattr(artifact, "build", refuse)
    second = small.stack(gain=5.0).compile(backend=backend)
    assert second.cached
    second["hand"].gain = first["hand"].gain
    assert small.command(second) == small.command(first)
    assert len(entries(folder)) == 1
    with pytest.raises(AssertionError, match="a graph was built"):
        small.stack(small.arm(length=0.6)).compile(backend=backend)
    assert len(entries(folder)) == 1, "a failed build leaves nothing"
    assert not [p for p in folder.iterdir() if p.is_dir() and p.name.startswith(".")]


def test_wbc_cache_chooses_the_folder(folder: Folder, tmp_path: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cache.root() == folder
    small.stack().compile(backend="vm")
    assert len(entries(folder)) == 1
    monkeypatch.setenv("WBC_CACHE", str(tmp_path / "deep" / "other"))
    assert not small.stack().compile(backend="vm").cached
    assert len(entries(tmp_path / "deep" / "other")) == 1
    monkeypatch.delenv("WBC_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "platform"))
    assert cache.root() == tmp_path / "platform" / "wbc"


def test_clear_leaves_nothing(folder: Folder) -> None:
    assert cache.clear() == 0
    small.stack().compile(backend="vm")
    small.stack().add(Damping()).compile(backend="vm")
    assert cache.clear() == 2
    assert list(folder.iterdir()) == []
    assert not small.stack().compile(backend="vm").cached


# Privacy


@pytest.mark.parametrize("backend", ["vm", "native"])
def test_entries_are_private(backend: str, folder: Folder) -> None:
    old = os.umask(0)  # the most careless user
    try:
        small.stack().compile(backend=backend)
    finally:
        os.umask(old)
    (entry,) = entries(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert entry.stat().st_mode & 0o777 == 0o700
    files = list(entry.iterdir())
    assert {p.name for p in files} == {cache.MANIFEST, "tick.so"} if backend == "native" else len(files) >= 2
    for path in files:
        assert path.stat().st_mode & 0o222 == 0, "nobody writes to a sealed file"
        assert path.stat().st_mode & 0o077 == 0, "nobody else reads it"


# Damage


def overwrite(path: Folder, content: bytes) -> None:
    """Put another read-only file into the place of one."""
    path.unlink()
    path.write_bytes(content)
    path.chmod(0o400)


def code(entry: Folder) -> Folder:
    return next(p for p in entry.iterdir() if p.name in ("tick.so", "rows.casadi"))


def manifest(entry: Folder) -> Folder:
    return entry / cache.MANIFEST


def corrupt(entry: Folder) -> None:
    content = bytearray(code(entry).read_bytes())
    content[len(content) // 2] ^= 0xFF
    overwrite(code(entry), bytes(content))


def empty_manifest(entry: Folder) -> None:
    overwrite(manifest(entry), b"{}")
    code(entry).unlink()


def linked_code(entry: Folder) -> None:
    elsewhere = entry.parent / ".elsewhere"
    code(entry).rename(elsewhere)
    (entry / ("tick.so" if elsewhere.read_bytes()[:4] == b"\x7fELF" else "rows.casadi")).symlink_to(elsewhere)


def linked_entry(entry: Folder) -> None:
    elsewhere = entry.parent / ".elsewhere"
    entry.rename(elsewhere)
    entry.symlink_to(elsewhere, target_is_directory=True)


def file_for_folder(entry: Folder) -> None:
    shutil.rmtree(entry)
    entry.write_bytes(b"not a folder")


def folder_for_file(entry: Folder) -> None:
    path = code(entry)
    path.unlink()
    path.mkdir()


DAMAGES: dict[str, Callable[[Folder], object]] = {
    "a changed byte": corrupt,
    "half of the code": lambda entry: overwrite(code(entry), code(entry).read_bytes()[:100]),
    "half of a manifest": lambda entry: overwrite(manifest(entry), manifest(entry).read_bytes()[:-5]),
    "an empty manifest": empty_manifest,
    "a strange manifest": lambda entry: overwrite(manifest(entry), json.dumps([[1], 2]).encode()),
    "a binary manifest": lambda entry: overwrite(manifest(entry), bytes(range(256))),
    "no manifest": lambda entry: manifest(entry).unlink(),
    "no code": lambda entry: code(entry).unlink(),
    "one more file": lambda entry: (entry / "more.so").write_bytes(b""),
    "code that the group may write": lambda entry: code(entry).chmod(0o420),
    "a manifest that others may write": lambda entry: manifest(entry).chmod(0o402),
    "a folder that the group may write": lambda entry: entry.chmod(0o770),
    "linked code": linked_code,
    "a linked entry": linked_entry,
    "a file for a folder": file_for_folder,
    "a folder for a file": folder_for_file,
}


@pytest.fixture(scope="module")
def wanted(tmp_path_factory: pytest.TempPathFactory) -> list[float]:
    """The command of the small stack, from a cache of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WBC_CACHE", str(tmp_path_factory.mktemp("sound")))
        return small.command(small.stack().compile(backend="vm"))


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Whether each entry was sound when a controller was made of it."""
    sound: list[bool] = []
    original = artifact.Artifact.__init__

    def watch(self: artifact.Artifact, *arguments: object, **named: object) -> None:
        sound.extend(cache._valid(p) for p in entries(cache.root()))
        original(self, *arguments, **named)

    monkeypatch.setattr(artifact.Artifact, "__init__", watch)
    return sound


@pytest.mark.parametrize(
    ("damage", "backend"),
    [*((damage, "vm") for damage in DAMAGES)]
    + [(damage, "native") for damage in ("a changed byte", "linked code", "code that the group may write")],
)
def test_damaged_entries_are_built_again(
    damage: str,
    backend: str,
    folder: Folder,
    wanted: list[float],
    loaded: list[bool],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Fill the cache, load nothing, damage it, compile, check."""
    artifact.compile_stack(small.stack(), backend, wbc.__version__)
    (entry,) = entries(folder)
    DAMAGES[damage](entry)
    caplog.clear()
    controller = small.stack().compile(backend=backend)
    assert not controller.cached, "a damaged entry was used"
    assert [r.name for r in caplog.records] == ["wbc"]
    assert "building it again" in caplog.text
    assert np.abs(np.subtract(small.command(controller), wanted)).max() < 1e-9
    assert small.stack().compile(backend=backend).cached, "the entry was not mended"
    assert len(entries(folder)) == 1
    assert not entries(folder)[0].is_symlink()
    assert loaded == [True, True, True]


# Parallel builds

WORKER = """
import json, pathlib, sys, time
from tests.stack import small
folder, backend = pathlib.Path(sys.argv[1]), sys.argv[2]
stack = small.stack()
(folder / ("ready-" + sys.argv[3])).touch()
while not (folder / "go").exists():
    time.sleep(0.002)
controller = stack.compile(backend=backend)
print(json.dumps([controller.cached, controller.backend, small.command(controller)]))
"""


#: The lock is the same for both: with ``REPEATS=3`` the virtual machine, too
@pytest.mark.parametrize("backend", ["native"] if MORE < ALL else ["native", "vm"])
def test_parallel_builds_end_in_one_entry(backend: str, folder: Folder, tmp_path: Folder) -> None:
    count = 2
    workers = [
        subprocess.Popen(
            [sys.executable, "-c", WORKER, str(tmp_path), backend, str(k)],
            cwd=ROOT,
            env={**os.environ, "WBC_CACHE": str(folder)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for k in range(count)
    ]
    while len(list(tmp_path.glob("ready-*"))) < count and all(w.poll() is None for w in workers):
        time.sleep(0.01)
    (tmp_path / "go").touch()
    said = [w.communicate(timeout=120) for w in workers]
    assert [w.returncode for w in workers] == [0] * count, said
    answers = [json.loads(out) for out, _ in said]
    wanted = small.stack().compile(backend=backend)
    # This process may have read the code long ago: a file of it that was edited since gives the workers another key
    assert wanted.cached, "no entry of this key: was the package's code edited while the tests ran?"
    assert len(entries(folder)) == 1
    assert not [p for p in folder.iterdir() if p.is_dir() and p.name.startswith(".")], "unfinished builds are left"
    assert sorted(cached for cached, _, _ in answers) == [False] + [True] * (count - 1), "the work was done once"
    for _, used, v in answers:
        assert used == backend
        assert v == small.command(wanted)


def test_of_two_finished_builds_the_first_stays(folder: Folder) -> None:
    """Where locks do nothing, the loser of the race takes the winner's entry."""

    def fill(text: str) -> Callable[[Folder], None]:
        return lambda place: (place / "a").write_text(text) and None

    def slow(place: Folder) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(cache, "lock", lambda *arguments: None)
            cache.fetch("name", fill("first"))
        fill("second")(place)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cache, "lock", lambda *arguments: None)
        place, _ = cache.fetch("name", slow)
    assert (place / "a").read_text() == "first"
    assert cache.fetch("name", fill("third")) == (place, True)


# Unusable folders


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("below a file", "Not a directory"),
        ("a file", "File exists"),
        ("others write", "others may write to it"),
        ("of somebody else", "it belongs to another user"),
        ("read-only", "it cannot be written to"),
    ],
)
def test_unusable_folders_are_replaced(
    kind: str, reason: str, folder: Folder, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    if kind.endswith("file"):
        folder.write_text("")
    else:
        folder.mkdir()
    if kind == "below a file":
        folder = folder / "below"
        monkeypatch.setenv("WBC_CACHE", str(folder))
    if kind == "others write":
        folder.chmod(0o777)
    if kind == "of somebody else":
        user = os.getuid()
        monkeypatch.setattr(cache.os, "getuid", lambda: user + 1 if user else 12345)
        # its own new folders belong to the made-up user, too
        monkeypatch.setattr(cache, "_private", lambda path: True)
        if user == 0:
            os.chown(folder, 54321, -1)
    if kind == "read-only":  # the superuser may write anywhere, so ask for the answer another user gets
        monkeypatch.setattr(cache.os, "access", lambda *arguments: False)
    before = set(folder.iterdir()) if folder.is_dir() else set()
    one = small.stack().compile(backend="vm")
    two = small.stack().compile(backend="vm")
    other = small.stack().add(Damping()).compile(backend="vm")
    assert [one.cached, two.cached, other.cached] == [False, True, False]
    assert small.command(one) == small.command(two)
    assert [(r.name, r.levelno) for r in caplog.records] == [("wbc", logging.WARNING)], "one line, not one a stack"
    assert reason in caplog.text
    assert str(cache.root()) in caplog.text
    assert (set(folder.iterdir()) if folder.is_dir() else set()) == before, "nothing is written there"
    instead = cache._instead(cache.root(), reason)
    assert instead.stat().st_mode & 0o777 == 0o700
    assert len(entries(instead)) == 2


def test_a_full_disk_is_replaced(
    folder: Folder, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    seal = cache._seal

    def sealed(fresh: Folder) -> None:
        if fresh.parent == folder:
            raise OSError(errno.ENOSPC, "")
        seal(fresh)

    monkeypatch.setattr(cache, "_seal", sealed)
    one, two = (small.stack().compile(backend="vm") for _ in range(2))
    assert (small.command(one), two.cached) == (small.command(two), True)
    assert caplog.text.count("No space left on device") == 1
    assert entries(folder) == []


def test_folders_may_have_any_name(tmp_path: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one of bytes that are no letters of the locale."""
    monkeypatch.setenv("WBC_CACHE", os.fsdecode(bytes(tmp_path) + b"/\xfc c"))
    one, two = (small.stack().compile(backend="vm") for _ in range(2))
    assert [one.cached, two.cached] == [False, True]
    assert small.command(one) == small.command(two)


def test_a_user_without_a_home_has_a_cache(tmp_path: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a container that runs under any user id."""

    def unknown(user: int) -> None:
        raise KeyError(user)

    for name in ("WBC_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert cache.root() == tmp_path / f"wbc-{os.getuid()}"


def test_temporary_folder_goes_with_its_process(tmp_path: Folder) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    script = (
        "import pathlib, sys\nfrom tests.stack import small\nc = small.stack().compile(backend='vm')\n"
        "small.command(c)\nprint(len(list(pathlib.Path(sys.argv[1]).iterdir())))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "temporary")],
        cwd=ROOT,
        env={**os.environ, "WBC_CACHE": str(tmp_path / "file"), "TMPDIR": str(tmp_path / "temporary")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["1"]
    assert done.stderr.count("cannot be used") == 1
    assert list((tmp_path / "temporary").iterdir()) == []


def test_a_read_only_folder_serves_what_it_has(
    folder: Folder, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    wanted = small.command(small.stack().compile(backend="vm"))
    monkeypatch.setattr(cache.os, "access", lambda *arguments: False)
    controller = small.stack().compile(backend="vm")
    assert controller.cached
    assert small.command(controller) == wanted
    assert caplog.records == []


def test_libraries_need_a_file_system_that_runs_them(
    folder: Folder, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    actual = os.statvfs

    def without(path: object) -> os.statvfs_result:
        found = actual(path)
        return os.statvfs_result((*found[:8], found.f_flag | os.ST_NOEXEC, *found[9:]))

    monkeypatch.setattr(cache.os, "statvfs", without)
    small.stack().compile(backend="vm")
    assert len(entries(folder)) == 1
    assert caplog.records == []
    assert small.stack().compile(backend="native").backend == "native"
    assert len(entries(folder)) == 1
    assert "noexec" in caplog.text


def test_a_sticky_folder_is_safe(folder: Folder) -> None:
    folder.mkdir()
    folder.chmod(0o1777)
    assert not small.stack().compile(backend="vm").cached
    assert small.stack().compile(backend="vm").cached
    assert len(entries(folder)) == 1


def test_answers_do_not_depend_on_the_cache() -> None:
    """Declared weights are not in the key, so they must still act."""
    light = Stack(small.arm(), small.DT).add(EndEffector("tip", kind="position"), name="hand")
    heavy = Stack(small.arm(), small.DT).add(EndEffector("tip", kind="position"), name="hand")
    light.add(Posture(), name="posture", weight=1e-3)
    heavy.add(Posture(gain=1.0), name="posture", weight=1e3)
    one, two = light.compile(backend="vm"), heavy.compile(backend="vm")
    assert two.cached
    assert not np.allclose(small.command(one), small.command(two), atol=1e-2)
    assert (one["posture"].gain, two["posture"].gain) == (Posture.default_gain, 1.0)


# Waiting


def test_who_waits_long_is_told_and_who_does_not_is_not(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def slow(place: Folder) -> None:
        time.sleep(0.3)
        (place / "file").touch()

    def interrupted(place: Folder) -> None:
        time.sleep(0.3)
        raise KeyboardInterrupt

    with caplog.at_level(logging.INFO, "wbc"):
        cache.fetch("not so slow", slow)
        assert caplog.messages == []
        monkeypatch.setattr(cache, "SLOW", 0.05)
        cache.fetch("slow", slow, what="a stack", advice="do this")
        *told, last = caplog.messages
        # A busy machine may sleep for longer than it is told to
        assert {re.sub(r"\d+", "0", line) for line in told} == {
            "compiling a stack: 0 s so far; it is kept for the next time; do this"
        }
        assert last.startswith("compiling a stack ended after ")
        caplog.clear()
        cache.fetch("slow", slow)
        assert caplog.messages == []
        with pytest.raises(KeyboardInterrupt):
            cache.fetch("interrupted", interrupted)
        *told, last = caplog.messages
        assert told
        assert "ended after" in last
    for thread in threading.enumerate():
        if thread.name == "compiling":
            thread.join(5.0)
            assert not thread.is_alive()
