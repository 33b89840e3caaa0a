"""What recordings refuse: files that are there, of another kind or damaged, and code that nobody trusts."""

from __future__ import annotations

import os
import pickle
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbc
from tests.record.test_recording import TOP, recorded, write
from tests.stack import small
from wbc import Recording, Stack, replay
from wbc.controller import core_of
from wbc.errors import PicklingError, UnknownNameError
from wbc.log import FileWriter
from wbc.record.recording import RecordingError
from wbc.tasks import Expression, Posture


def test_files_are_not_written_over_by_accident(tmp_path: Path) -> None:
    one = small.stack().compile(backend="vm")
    run = recorded(tmp_path / "run.npz")
    before = run.read_bytes()
    with pytest.raises(RecordingError, match="there is a file"):
        one.record(run)
    assert run.read_bytes() == before
    with one.record(run, overwrite=True), pytest.raises(RecordingError, match=r"records into .*run\.npz already"):
        one.record(tmp_path / "other.npz")
    assert len(Recording(run)["q"]) == 0
    assert replay(run).ticks == 0
    with pytest.raises(RecordingError, match="cannot be written: No such file"):
        one.record(tmp_path / "none" / "run.npz")
    assert core_of(one).recording is None


def rewritten(source: Path, target: Path, **changes: Any) -> Path:
    """The recording with other facts about it."""
    made = Recording(source)
    write(target, made, made.rows(), **changes)
    return target


def test_recordings_of_another_kind_are_refused(tmp_path: Path) -> None:
    run, other = recorded(tmp_path / "run.npz"), tmp_path / "other.npz"
    with pytest.raises(RecordingError, match="of another format, this version reads 2"):
        replay(rewritten(run, other, format=1))
    with pytest.raises(RecordingError, match="made by another version of wbc"):
        replay(rewritten(run, other, wbc="0.0.1"))
    with pytest.raises(RecordingError, match=r"is of another stack: .* not .*more"):
        replay(run, small.stack().add(Posture(), name="more"))
    with pytest.raises(RecordingError, match="is of another stack"):
        replay(run, small.stack(small.arm(length=0.6)))
    sizes = Recording(run).about["sizes"]
    with pytest.raises(RecordingError, match="is of another layout"):
        replay(rewritten(run, other, sizes=sizes | {"p": sizes["p"] - 1, "weight": sizes["weight"] + 1}))
    with pytest.raises(UnknownNameError, match="did you mean 'native'"):
        replay(run, backend="nativ")
    found = replay(rewritten(run, other, versions={**Recording(run).about["versions"], "daqp": "0.1"}))
    assert found.identical
    assert len(found.notes) == 1
    assert found.notes[0].startswith("daqp was 0.1, is ")
    assert replay(run, small.stack()).identical


def test_files_that_are_no_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        Recording(tmp_path / "none.npz")
    bad = tmp_path / "bad.npz"
    for content in (b"", b"PK", os.urandom(3000), b"PK\x03\x04" + bytes(100)):
        bad.write_bytes(content)
        with pytest.raises(RecordingError, match="no recording"):
            Recording(bad)
    np.savez(bad, q=np.zeros(3))
    with pytest.raises(RecordingError, match="no recording"):
        Recording(bad)
    np.savez_compressed(bad, q=np.zeros(3))
    with pytest.raises(RecordingError, match="no recording"):
        Recording(bad)
    run = recorded(tmp_path / "run.npz")
    whole = bytearray(run.read_bytes())
    whole[whole.index(b"ticks.000000") + 400] ^= 1
    bad.write_bytes(whole)
    with pytest.raises(RecordingError, match=r"the part ticks\.000000\.npy is damaged"):
        replay(bad)


# The stack in the file


def with_lambda() -> Stack:
    return small.stack().add(Expression(lambda kin, p: kin.q[0] - 0.1, units="rad"), name="mine")


def test_code_in_a_file_runs_only_if_it_is_trusted(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run.npz", with_lambda())
    with pytest.raises(PicklingError, match="not this package's"):
        replay(run)
    assert replay(run, trust=True).identical
    assert replay(run, with_lambda()).identical


class Trap:
    """A pickle that does something when it is read."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.what = (function, arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.what


@pytest.mark.parametrize(
    "trap",
    [
        lambda p: Trap(os.mkdir, str(p)),
        lambda p: Trap(shutil.copytree, str(TOP / "requirements"), str(p)),
        lambda p: Trap(eval, f"__import__('os').mkdir({str(p)!r})"),
        lambda p: Trap(FileWriter, p, False),
        lambda p: Trap(wbc.native.toolchain.compile_tick, {}, p),
    ],
)
def test_a_trap_does_not_spring(trap: Any, tmp_path: Path) -> None:
    made = Recording(recorded(tmp_path / "run.npz"))
    made.stack_pickle = pickle.dumps(trap(tmp_path / "sprung"))
    with pytest.raises(PicklingError, match="asks for code that is not this package's"):
        replay(made)
    assert not (tmp_path / "sprung").exists()


def test_names_that_lead_out_of_the_package_are_refused(tmp_path: Path) -> None:
    """``module.attribute`` paths, and names that a module of ours has only imported."""
    made = Recording(recorded(tmp_path / "run.npz"))
    for module, name in (
        ("wbc.robot.robot", "hashlib.sha256"),
        ("wbc.tasks.base", "np.load"),
        ("wbc.robot.robot", "replace"),
    ):
        text = [b"\x80\x04\x8c", bytes([len(module)]), module.encode(), b"\x8c", bytes([len(name)]), name.encode()]
        made.stack_pickle = b"".join([*text, b"\x93."])
        with pytest.raises(PicklingError, match="not this package's"):
            replay(made)
    for data, reason in ((b"nonsense", "cannot be read"), (pickle.dumps(Posture()), "holds no stack")):
        made.stack_pickle = data
        with pytest.raises(PicklingError, match=reason):
            replay(made)


def test_a_stack_that_does_not_pickle_is_recorded_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "cloudpickle", None)
        run = recorded(tmp_path / "run.npz", with_lambda())
    assert Recording(run).stack_pickle is None
    with pytest.raises(
        RecordingError, match=r"holds no stack, which could not be pickled \(mine\.Expression\.function"
    ):
        replay(run)
    assert replay(run, with_lambda()).identical
