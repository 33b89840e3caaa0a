"""The log of a run: named columns with units, and what they mean; kept as Parquet or npz."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.errors import WbcError
from wbc.validation import Array

FORMATS = ("parquet", "npz")
_META = "wbc"


class LogFileError(WbcError):
    """A log that is missing or cannot be read."""


@dataclass(frozen=True, eq=False)
class Log:
    """A run as recorded.

    Attributes:
        columns: name -> one value a tick. Names are ``group.member``: ``t``, ``q.*``, ``v.*``, ``a.*``, ``pose.*``,
            ``target.*``, ``error.TASK.ROW``, ``plane.*``, ``margin.ITEM.ROW``, ``clearance.LINK``,
            ``binding.*``, ``relaxed.*``, ``status``, ``iterations``, ``error_bound``, ``tick``.
        units: name -> unit; "" for pure numbers, codes and flags.
        meta: robot, stack, versions, timing: plain data.
    """

    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    meta: Mapping[str, Any]

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


def save(log: Log, folder: pathlib.Path, kind: str = "parquet") -> pathlib.Path:
    """Write a log into a folder, which is made where it is not there, whole or not at all; returns the file.

    Raises:
        ShapeError: no log, or no folder's name. LogFileError: it cannot be written.
        UnknownNameError: another format than ``parquet`` or ``npz``.
    """
    validation.one_of("log", kind, FORMATS)
    validation.instance("log", log, Log, "a Log")
    folder = validation.file_path("folder", folder)
    file = folder / f"log.{kind}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write(log, folder, kind, file)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise LogFileError("folder", str(file), f"cannot be written: {error}") from error
    return file


def _write(log: Log, folder: pathlib.Path, kind: str, file: pathlib.Path) -> None:
    text = json.dumps({"units": dict(log.units), "meta": dict(log.meta)})
    # Written beside its place and renamed into it, so that no reader ever meets half a file
    fresh = folder / f".log.{kind}"
    if kind == "npz":
        arrays: dict[str, Any] = {**log.columns, f"__{_META}__": np.array(text)}
        with fresh.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)
    else:
        extras.require("recordings", "a log of kind parquet")
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = pa.table({name: pa.array(values) for name, values in log.columns.items()})
        fields = [f.with_metadata({"unit": log.units[f.name]}) for f in table.schema]
        schema = pa.schema(fields, metadata={_META: text})
        pq.write_table(pa.Table.from_arrays(table.columns, schema=schema), fresh)
    fresh.replace(file)


def load(run: str | os.PathLike[str]) -> Log:
    """The log of a run, from its folder or from the file itself.

        log = wbc.track.load("runs/demo")
        log["t"], log.group("q"), log.meta["robot"]

    Raises:
        LogFileError: there is no log, or it cannot be read.
    """
    path = validation.file_path("run", run)
    if not validation.exists("run", path):
        raise LogFileError("run", str(path), validation.no_such(path, "there is no such file or folder"))
    if path.is_dir():
        found = [path / f"log.{kind}" for kind in FORMATS if (path / f"log.{kind}").is_file()]
        if not found:
            raise LogFileError("run", str(path), "the folder has no log", [f"log.{kind}" for kind in FORMATS])
        path = found[0]
    if not path.is_file():
        raise LogFileError("run", str(path), "there is no such file or folder")
    try:
        columns, text = _read_npz(path) if path.suffix == ".npz" else _read_parquet(path)
        data = json.loads(text)
        return Log(columns, data["units"], data["meta"])
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise LogFileError("run", str(path), f"no log of this package: {error}") from error


def _read_npz(path: pathlib.Path) -> tuple[dict[str, np.ndarray], str]:
    with np.load(path, allow_pickle=False) as data:
        key = f"__{_META}__"
        return {name: data[name] for name in data.files if name != key}, str(data[key])


def _read_parquet(path: pathlib.Path) -> tuple[dict[str, np.ndarray], str]:
    extras.require("recordings", "a log of kind parquet")
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    return columns, (table.schema.metadata or {})[_META.encode()].decode()
