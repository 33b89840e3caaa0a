"""Many controllers of one compiled stack: threads and processes give the bits of one after the other."""

from __future__ import annotations

import multiprocessing
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.controller.stacks import arm, controller, near_limits, randomise, robot
from tests.stack import small
from wbc import Controller, Stack
from wbc.controller import core_of
from wbc.errors import BusyError
from wbc.shapes import Box
from wbc.stack import artifact
from wbc.tasks import Damping, Expression, Obstacle

BACKENDS = ("vm", "native")
TICKS = {"vm": 15, "native": 60}
#: Small enough that threads take turns within most ticks
SWITCH = 1e-6


@pytest.fixture(autouse=True)
def hasty() -> Iterator[None]:
    """Threads that are made to take turns as often as the interpreter can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH)
    yield
    sys.setswitchinterval(before)


def work(one: Controller, seed: int, count: int) -> list[bytes]:
    """All numbers of some ticks at random states; now and then all run-time values change, or a reset."""
    rng, bot = np.random.default_rng(seed), one.stack.robot
    out = []
    one.reset(near_limits(bot, rng))
    for k in range(count):
        if k % 10 == 0:
            randomise(one, rng)
        if k % 37 == 36:
            one.reset(near_limits(bot, rng))
        out.append(one.step(near_limits(bot, rng), rng.normal(size=bot.nv) if k % 3 else None)._data)
    return out


@pytest.mark.parametrize("backend", BACKENDS)
def test_threads_give_the_bits_of_one_after_the_other(backend: str) -> None:
    count, threads = TICKS[backend], 5
    first = controller("arm", "panda", backend=backend)
    wanted = [work(first.clone(), seed, count) for seed in range(threads)]
    crew = [first.clone() for _ in range(threads - 1)] + [first.stack.compile(backend=backend)]
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(work, crew, range(threads), [count] * threads))
    assert found == wanted
    assert len({d for done in found for d in done}) > threads * count // 2, "states must differ"


def test_threads_with_sensors() -> None:
    """Distances by Coal, which have memory of their own in every controller."""
    stack = arm(obstacle=False).add(Obstacle(Box((0.1, 0.2, 0.3)), margin=0.01, closest=3), name="box")
    stack.add(Damping(), name="damping")
    first = stack.compile(backend="vm")
    assert first["box"].distance.size > 0
    wanted = [work(first.clone(), seed, 12) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(work, [first.clone() for _ in range(4)], range(4), [12] * 4))
    assert found == wanted


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_clone_goes_on_as_its_original_would(backend: str) -> None:
    """After a reset of the solver: that is the one thing that it does not take over."""
    one = controller("everything", "panda", backend="vm") if backend == "vm" else controller("arm", backend=backend)
    rng, bot = np.random.default_rng(4), one.stack.robot
    assert str(one.clone()) == str(one)
    for _ in range(3):
        one.step(near_limits(bot, rng), rng.normal(size=bot.nv), one.stack.dt * 1.5)
    randomise(one, rng)
    other = one.clone()
    assert str(other) == str(one)
    assert np.array_equal(other.last_command, one.last_command)
    path = [near_limits(bot, rng) for _ in range(4)]
    core_of(one).tick.reset()
    assert [other.step(q)._data for q in path] == [one.step(q)._data for q in path]
    # and does not touch it
    text = str(one)
    other["hand"].weight, other["hand"].enabled, other["posture"].mask = 7.0, False, 0.0
    assert (str(one), str(other) != text) == (text, True)


def test_a_clone_waits_for_its_own_first_configuration() -> None:
    """Targets that nobody has set come from the first step of each; those that were set stay."""
    one = small.stack().compile(backend="vm")
    one["hand"].target = small.TARGET
    other = one.clone()
    one.step((0.1, 0.2))
    other.step((0.5, 0.6))
    assert one["posture"].target.tolist() == [0.1, 0.2]
    assert other["posture"].target.tolist() == [0.5, 0.6]
    assert np.array_equal(other["hand"].target, small.TARGET)
    later = one.clone()
    assert later["posture"].target.tolist() == [0.1, 0.2]
    later.reset((0.3, 0.3))
    assert later["posture"].target.tolist() == [0.3, 0.3]
    assert np.array_equal(later["hand"].target, small.TARGET)


def test_a_clone_reads_nothing_and_builds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    first = small.stack().compile(backend="native")

    def refuse(*arguments: object, **named: object) -> None:
        raise AssertionError("not needed for a clone")

    monkeypatch.setattr(artifact, "build", refuse)
    monkeypatch.setattr(artifact.cache, "fetch", refuse)
    monkeypatch.setattr(artifact, "key", refuse)
    other = first.clone()
    assert small.command(other) == small.command(first)
    maps = Path("/proc/self/maps").read_text()
    assert maps.count(core_of(first).tick._library._name) in range(1, 8), "one library, however many controllers"
    assert core_of(other).tick._library._handle == core_of(first).tick._library._handle


# One controller in two threads


def test_one_controller_in_two_threads_is_an_error() -> None:
    one = small.stack().compile(backend="vm")
    inside, go_on = threading.Event(), threading.Event()
    call = core_of(one).call

    def slow() -> int:
        inside.set()
        assert go_on.wait(20.0)
        return call()

    core_of(one).call = slow
    found: list[Any] = []
    other = threading.Thread(target=lambda: found.append(one.step(small.Q)))
    other.start()
    assert inside.wait(20.0)
    with pytest.raises(BusyError, match="in use by another thread"):
        one.step((9.0, 9.0))
    go_on.set()
    other.join()
    # the tick that was under way is as if nobody had come
    fresh = small.stack().compile(backend="vm")
    assert found[0]._data == fresh.step(small.Q)._data
    core_of(one).call = call
    assert one.step(small.Q)._data == fresh.step(small.Q)._data


def test_inputs_may_be_written_while_another_thread_steps() -> None:
    """Each tick has the whole of one target or of the other, never half of each."""
    one = controller("arm", "panda", backend="native")
    bot = one.stack.robot
    q = bot.neutral
    one.reset(q)
    one["hand"].enabled = False
    ends = [np.full(7, 0.3), np.full(7, -0.3)]
    wanted = set()
    for end in ends:
        one["posture"].target = end
        wanted.add(one.step(q).residuals["posture"].values.tobytes())
    stop = threading.Event()

    def write() -> None:
        while not stop.is_set():
            for end in ends:
                one["posture"].target = end

    writer = threading.Thread(target=write)
    writer.start()
    found: set[bytes] = set()
    ticks, until = 0, time.monotonic() + 30.0
    # On a busy machine the writer waits for its turn
    while ticks < 1000 or (found < wanted and time.monotonic() < until):
        found.add(one.step(q).residuals["posture"].values.tobytes())
        ticks += 1
    stop.set()
    writer.join()
    assert found == wanted


# Compiling at the same time


def unlike_any(number: float) -> Stack:
    """A stack that no other test compiles."""
    return small.stack().add(Expression(lambda kin, p: kin.q[0] - number, units="rad"), name="mine")


@pytest.mark.parametrize("backend", BACKENDS)
def test_two_threads_compile_one_stack(backend: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WBC_CACHE", str(tmp_path))
    builds: list[int] = []
    build = artifact.build
    monkeypatch.setattr(artifact, "build", lambda *a, **k: builds.append(1) or build(*a, **k))
    stack = unlike_any(0.125)
    together = threading.Barrier(3)

    def compiled(_: int) -> Controller:
        together.wait(20.0)
        return stack.compile(backend=backend)

    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(compiled, range(3)))
    assert sorted(one.cached for one in found) == [False, True, True]
    assert len(builds) == 1
    assert len([p for p in tmp_path.iterdir() if not p.name.startswith(".")]) == 1
    assert len({tuple(small.command(one)) for one in found}) == 1


# Processes


def child(pickled: bytes, backend: str, seed: int) -> list[bytes]:
    """What a process does with a stack that it was given."""
    return work(pickle.loads(pickled).compile(backend=backend), seed, 40)


_inherited: Callable[[int], list[bytes]] | None = None


def heir(seed: int) -> list[bytes]:
    """What a forked process does with a controller that it has inherited."""
    assert _inherited is not None
    return _inherited(seed)


def test_spawned_processes() -> None:
    wanted, jobs = [], []
    for backend in BACKENDS:
        first = controller("arm", "panda", backend=backend)
        wanted += [work(first.clone(), seed, 40) for seed in range(3)]
        jobs += [(pickle.dumps(first.stack), backend, seed) for seed in range(3)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.starmap(child, jobs) == wanted


@pytest.mark.parametrize("backend", BACKENDS)
def test_forked_processes_inherit_controllers(backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has its own copy from there on, in its own memory."""
    first = controller("arm", "panda", backend=backend)
    here = work(first.clone(), 9, 40)
    wanted = [work(first.clone(), seed, 40) for seed in range(3)]
    used = first.clone()
    monkeypatch.setattr(sys.modules[__name__], "_inherited", lambda seed: work(used, seed, 40))
    with multiprocessing.get_context("fork").Pool(2) as pool:
        found = pool.map(heir, range(3))
    assert found == wanted
    assert work(used, 9, 40) == here
    assert robot("panda") is used.stack.robot
