"""Logs of random columns: as they were recorded, from any file that there is of them, cut off anywhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbc
from tests.repeats import repeats
from tests.stack import small
from wbc.errors import RangeError, WbcError
from wbc.log import FileWriter, Log, LogFile, LogFileError, TickRecorder, load, save

KINDS = {"f8": np.float64, "i8": np.int64, "i1": np.int8, "?": np.bool_}


class Elsewhere:
    """A writer that keeps what it is told, as one for another format would."""

    def __init__(self, full: int = 1 << 30) -> None:
        self.about: Mapping[str, Any] = {}
        self.numbers, self.tables, self.closed, self._full = b"", dict[str, np.ndarray](), False, full

    def begin(self, about: Mapping[str, Any], attached: Mapping[str, bytes]) -> None:
        self.about = json.loads(json.dumps(about))

    def table(self, name: str, values: np.ndarray) -> None:
        self.tables[name] = values

    def write(self, numbers: bytes) -> None:
        if len(self.numbers) + len(numbers) > self._full:
            raise OSError(28, "No space left on device")
        self.numbers += numbers

    def close(self) -> None:
        self.closed = True

    def abandon(self) -> None:
        self.closed = True


def recorder(rng: np.random.Generator) -> tuple[TickRecorder, list[str]]:
    """Of a random run: its columns, of which some do not change for a while, and the kinds of these."""
    kinds = ["f8", *rng.choice(list(KINDS), rng.integers(0, 12)).tolist()]
    columns = {f"c{k}.member {k}": ("m/s" if kind == "f8" else "", kind) for k, kind in enumerate(kinds)}
    columns = {"t": ("s", "f8"), **columns}
    return TickRecorder(columns, {"seed": 7, "text": "\u00e9"}, int(rng.integers(1, 40))), ["f8", *kinds]


def ticks(rng: np.random.Generator, kinds: list[str], count: int) -> np.ndarray:
    """Numbers that each kind can have."""
    rows = rng.normal(size=(count, len(kinds)))
    rows[rng.random(rows.shape) < 0.1] = rng.choice([np.inf, -np.inf, np.nan, -0.0, 5e-324])
    for k, kind in enumerate(kinds):
        if kind != "f8":
            rows[:, k] = rng.integers(0, 2, count) if kind == "?" else rng.integers(-100, 100, count)
        if rng.random() < 0.4:
            rows[:, k] = rows[0, k]
    return rows


def same(one: Log, other: Log, count: int | None = None) -> None:
    """Bit for bit, the first ``count`` ticks."""
    assert list(one.columns) == list(other.columns)
    for name, values in one.columns.items():
        assert values.dtype == other[name].dtype
        assert values.tobytes() == other[name][:count].tobytes()
    assert (one.units, one.meta) == (other.units, other.meta)


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_a_run_is_read_as_it_was_recorded(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    made, kinds = recorder(rng)
    ends = [0]
    made.write_to(FileWriter(tmp_path / "run.part", overwrite=False))
    table = rng.normal(size=(3, 2))
    for _ in range(rng.integers(1, 6)):
        made.extend(ticks(rng, kinds, int(rng.integers(1, 60))))
        table = table + 1.0
        made.send({"holds": table})
        ends.append(len(made))
    made.close()
    log = made.log({"holds": table})
    for again in (load(tmp_path), load(save(log, tmp_path / "whole", "npz"))):
        same(again, log)
        assert again.tables["holds"].tobytes() == table.tobytes()
    with pytest.raises(RangeError, match=r"log\.tables"):
        save(log, tmp_path, "parquet")
    same(load(save(made.log(), tmp_path, "parquet")), log)
    whole = (tmp_path / "run.part").read_bytes()
    with np.load(tmp_path / "run.part") as data:
        assert json.loads(data["about.json"])["meta"] == log.meta
    seen = set()
    for cut in rng.integers(0, len(whole), 12):
        (tmp_path / "cut.part").write_bytes(whole[:cut])
        try:
            part = load(tmp_path / "cut.part")
        except LogFileError:
            assert cut < whole.index(b"holds.000000")
            continue
        seen.add(len(part))
        same(part, log, len(part))
        assert not LogFile(tmp_path / "cut.part").complete
    assert seen <= set(ends)
    assert LogFile(tmp_path / "run.part").complete


def test_a_log_goes_to_whatever_writes() -> None:
    rng = np.random.default_rng(1)
    made, kinds = recorder(rng)
    made.extend(first := ticks(rng, kinds, 5))
    writer = Elsewhere()
    made.write_to(writer)
    made.send({"holds": np.eye(2)})
    made.extend(ticks(rng, kinds, 4))
    made.close()
    assert writer.closed
    assert list(writer.about["sizes"]) == list(made.log().columns)
    assert writer.about["meta"] == {"seed": 7, "text": "\u00e9"}
    assert writer.numbers == made.rows.tobytes()
    assert made.rows[:5].tobytes() == first.tobytes()
    assert np.array_equal(writer.tables["holds"], np.eye(2))


def test_a_writer_that_fails_does_not_end_the_run(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(2)
    made, kinds = recorder(rng)
    writer = Elsewhere(full=8 * len(kinds) * 10)
    made.write_to(writer)
    for _ in range(4):
        made.extend(ticks(rng, kinds, 6))
        made.send()
    made.close()
    assert len(writer.numbers) == 8 * len(kinds) * 6
    assert len(made.log()) == 24
    again = Elsewhere()
    monkeypatch.setattr(again, "close", lambda: again.write(bytes(8)))
    again._full = 8 * len(kinds) * 24
    made.write_to(again)
    made.close()
    assert [record.getMessage() for record in caplog.records] == [
        "what is written of the run ends after 6 ticks: No space left on device",
        "what is written of the run ends after 24 ticks: No space left on device",
    ]


@pytest.mark.parametrize("seed", range(repeats(4)))
def test_no_junk_is_a_log(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    made, kinds = recorder(rng)
    made.write_to(FileWriter(tmp_path / "run.part", overwrite=False))
    made.extend(ticks(rng, kinds, 50))
    made.close()
    whole = (tmp_path / "run.part").read_bytes()
    for _ in range(20):
        place = int(rng.integers(0, len(whole)))
        junk = bytearray(whole)
        junk[place : place + 40] = rng.bytes(min(40, len(whole) - place))
        for name in ("junk.part", "junk.npz", "junk.parquet"):
            (tmp_path / name).write_bytes(junk)
            try:
                found = load(tmp_path / name)
            except WbcError:
                continue
            # What was spoiled is the directory, which only numpy reads
            same(found, made.log(), len(found))


def test_a_recording_says_who_reads_it(tmp_path: Path) -> None:
    controller = small.stack().compile(backend="vm")
    with controller.record(tmp_path / "ticks.npz"):
        for k in range(5):
            step = controller.step((0.1 * k, 0.8))
    with pytest.raises(LogFileError, match=r"wbc\.Recording"):
        load(tmp_path / "ticks.npz")
    recording = wbc.Recording(tmp_path / "ticks.npz")
    log = recording.log()
    np.testing.assert_array_equal(log["t"], recording.time)
    np.testing.assert_array_equal(log.array("q")[:, 0], 0.1 * np.arange(5))
    np.testing.assert_array_equal(log.array("v")[-1], step.v)
    same(load(save(log, tmp_path, "npz")), log)
