"""The log of a run: named columns with units, and what they mean; whole as Parquet or npz, or as far as it came."""

from __future__ import annotations

import json
import os
import pathlib
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.archives import open_npz
from wbc.errors import RangeError
from wbc.log.file import LogFile, LogFileError
from wbc.validation import Array

FORMATS = ("parquet", "npz")
#: Logs in a run's folder, of which the first that is there is read: whole ones, and one that is still written
FILES = (*(f"log.{kind}" for kind in FORMATS), "log.part", "run.npz", "run.part")
#: Key of what a file says about its columns
_META = "wbc"
#: What keys of tables begin with
_TABLE = "table:"


@dataclass(frozen=True, eq=False)
class Log:
    """A run as recorded.

    Attributes:
        columns: name -> one value a tick. Names are ``group.member``: ``t``, ``q.*``, ``v.*``, ``a.*``, ``pose.*``,
            ``target.*``, ``error.TASK.ROW``, ``plane.*``, ``margin.ITEM.ROW``, ``clearance.LINK``,
            ``binding.*``, ``relaxed.*``, ``status``, ``iterations``, ``error_bound``, ``tick``.
        units: name -> unit; "" for pure numbers, codes and flags.
        meta: robot, stack, versions, timing: plain data.
        tables: name -> numbers that are no column, as the holds of a walk.
    """

    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    meta: Mapping[str, Any]
    tables: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        validation.one_of("column", name, self.columns)
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.columns

    def __len__(self) -> int:
        return len(self.columns["t"])

    def group(self, name: str) -> dict[str, np.ndarray]:
        """The columns ``name.*`` by the rest of their names."""
        return {key[len(name) + 1 :]: value for key, value in self.columns.items() if key.startswith(f"{name}.")}

    def array(self, name: str) -> Array:
        """The columns ``name.*`` side by side, ticks x members."""
        members = list(self.group(name).values())
        return np.column_stack(members) if members else np.zeros((len(self), 0))


def joined(logs: Sequence[Log], units: Mapping[str, str], meta: Mapping[str, Any]) -> Log:
    """Logs of one run after each other, with the tables of the last; none: no ticks."""
    columns = {name: np.concatenate([log[name] for log in logs] or [np.zeros(0)]) for name in units}
    return Log(columns, units, meta, logs[-1].tables if logs else {})


def save(log: Log, folder: pathlib.Path, kind: str = "parquet", name: str = "log") -> pathlib.Path:
    """Write a log into a folder, which is made where it is not there, whole or not at all; returns the file.

    Args:
        kind: ``parquet`` or ``npz``, whose suffix the file has. name: of the file without it.

    Raises:
        ShapeError: no log, or no folder's name. LogFileError: it cannot be written.
        UnknownNameError: another format. RangeError: tables, which Parquet cannot hold.
    """
    validation.one_of("log", kind, FORMATS)
    validation.instance("log", log, Log, "a Log")
    if kind == "parquet" and log.tables:
        raise RangeError("log.tables", sorted(log.tables), "a Parquet file has columns alone; choose npz")
    folder = validation.file_path("folder", folder)
    file = folder / f"{name}.{kind}"
    with validation.replacing("folder", file, LogFileError, KeyError, TypeError, ValueError) as fresh:
        folder.mkdir(parents=True, exist_ok=True)
        _write(log, kind, fresh)
    return file


def _write(log: Log, kind: str, file: pathlib.Path) -> None:
    text = json.dumps({"units": dict(log.units), "meta": dict(log.meta)})
    if kind == "npz":
        tables = {f"{_TABLE}{name}": values for name, values in log.tables.items()}
        arrays: dict[str, Any] = {**log.columns, **tables, f"__{_META}__": np.array(text)}
        with file.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)
        return
    extras.require("recordings", "a log of kind parquet")
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: pa.array(values) for name, values in log.columns.items()})
    fields = [f.with_metadata({"unit": log.units[f.name]}) for f in table.schema]
    schema = pa.schema(fields, metadata={_META: text})
    pq.write_table(pa.Table.from_arrays(table.columns, schema=schema), file)


def load(run: str | os.PathLike[str]) -> Log:
    """The log of a run, from its folder or from the file itself; of a run that was killed as far as it was written.

        log = wbc.log.load("runs/demo")
        log["t"], log.group("q"), log.meta["robot"]

    Raises:
        LogFileError: there is no log, or it cannot be read.
    """
    path = validation.existing("run", run, LogFileError)
    if path.is_dir():
        found = [path / name for name in FILES if (path / name).is_file()]
        if not found:
            raise LogFileError("run", str(path), "the folder has no log", FILES)
        path = found[0]
    if not path.is_file():
        raise LogFileError("run", str(path), "there is no such file or folder")
    try:
        if path.suffix == ".parquet":
            return _read_parquet(path)
        return _read_npz(path) if path.suffix == ".npz" else _read_part(LogFile(path))
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise LogFileError("run", str(path), f"no log of this package: {error}") from error


def _read_part(file: LogFile) -> Log:
    if "kinds" not in file.about:
        raise LogFileError("run", str(file.path), "a recording of ticks: wbc.Recording(run).log() is its log")
    return replace(log_of(file, file.rows()), tables=file.tables())


def log_of(file: LogFile, rows: Array) -> Log:
    """Rows of a file that a :class:`~wbc.log.TickRecorder` wrote, as a log without tables."""
    kinds = file.about["kinds"]
    columns = {name: rows[:, place.start].astype(kinds[name]) for name, place in file.parts.slices.items()}
    return Log(columns, file.about["units"], file.about["meta"])


def _read_npz(path: pathlib.Path) -> Log:
    with open_npz(path) as data:
        if "about.json" in data.files:
            return _read_part(LogFile(path))
        read = {name: data[name] for name in data.files}
    if f"__{_META}__" not in read:
        raise ValueError("it does not say what its columns are")
    said = json.loads(str(read.pop(f"__{_META}__")))
    tables = {name.removeprefix(_TABLE): read.pop(name) for name in list(read) if name.startswith(_TABLE)}
    return Log(read, said["units"], said["meta"], tables)


def _read_parquet(path: pathlib.Path) -> Log:
    extras.require("recordings", "a log of kind parquet")
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    said = json.loads((table.schema.metadata or {})[_META.encode()].decode())
    return Log(columns, said["units"], said["meta"])
