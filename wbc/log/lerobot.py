"""Datasets in LeRobot's layout, version 3.0, without images: numbers of a robot over episodes."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wbc import extras
from wbc.validation import Array

#: Version of the layout that is written
VERSION = "v3.0"
#: Where the frames of a chunk's file are, as the layout names them
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
#: Files of a folder at most, as LeRobot proposes
CHUNKS_SIZE = 1000
#: Size of a file at most, as LeRobot proposes [MB]
FILE_MEGABYTES = 100


def write_lerobot_dataset(
    folder: pathlib.Path,
    robot: str,
    rate: int,
    names: Mapping[str, Sequence[str]],
    episodes: Sequence[Mapping[str, Array]],
    tasks: Sequence[str],
) -> None:
    """Write a dataset into a folder, which is there.

    Args:
        rate: frames a second [Hz]. names: feature, such as ``observation.state`` -> names of its numbers.
        episodes: feature -> numbers [frames, names] of each episode. tasks: what each episode is, in words.

    Raises:
        MissingPackageError: pyarrow is not installed. OSError: the folder cannot be written.
    """
    extras.require("recordings", "a dataset of LeRobot")
    features: dict[str, Any] = {
        name: {"dtype": "float32", "shape": [len(members)], "names": list(members)} for name, members in names.items()
    }
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    counters = ("frame_index", "episode_index", "index", "task_index")
    features |= {name: {"dtype": "int64", "shape": [1], "names": None} for name in counters}
    said = list(dict.fromkeys(tasks))
    parts: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    total = 0
    for number, (episode, task) in enumerate(zip(episodes, tasks, strict=True)):
        count = np.arange(len(next(iter(episode.values()))))
        numbers = (count, 0 * count + number, count + total, 0 * count + said.index(task))
        part: dict[str, Any] = {**episode, "timestamp": count / rate, **dict(zip(counters, numbers, strict=True))}
        row = {"episode_index": number, "tasks": [task], "length": len(count), "dataset_from_index": total}
        row |= {f"{kind}/{what}_index": 0 for kind in ("data", "meta/episodes") for what in ("chunk", "file")}
        total += len(count)
        parts.append(part)
        rows.append(row | {"dataset_to_index": total} | _flat(part))
    whole = {name: np.concatenate([part[name] for part in parts]) for name in features}
    _write(folder, DATA.format(chunk_index=0, file_index=0), {n: _column(v, features[n]) for n, v in whole.items()})
    _write(folder, "meta/tasks.parquet", {"task_index": list(range(len(said))), "task": said})
    _write(folder, "meta/episodes/chunk-000/file-000.parquet", {name: [row[name] for row in rows] for name in rows[0]})
    info = {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": len(rows),
        "total_frames": total,
        "total_tasks": len(said),
        "chunks_size": CHUNKS_SIZE,
        "data_files_size_in_mb": FILE_MEGABYTES,
        "video_files_size_in_mb": 0,
        "fps": rate,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": DATA,
        "video_path": None,
        "features": features,
    }
    (folder / "meta/info.json").write_text(json.dumps(info, indent=1), encoding="utf-8")
    stats = {name: _statistics(values) for name, values in whole.items()}
    (folder / "meta/stats.json").write_text(json.dumps(stats, indent=1), encoding="utf-8")


def _flat(part: Mapping[str, Array]) -> dict[str, list[float]]:
    """Statistics of an episode as columns."""
    return {f"stats/{name}/{kind}": v for name, values in part.items() for kind, v in _statistics(values).items()}


def _write(folder: pathlib.Path, name: str, columns: dict[str, Any]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    place = folder / name
    place.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table(columns)
    if name == "meta/tasks.parquet":
        # The text is the index of a table of pandas, as LeRobot looks tasks up by it
        kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
        columns_said = [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": plain, "metadata": None}
            for name, (kind, plain) in kinds.items()
        ]
        said = {"index_columns": ["task"], "columns": columns_said, "column_indexes": [], "pandas_version": "2.0.0"}
        table = table.replace_schema_metadata({"pandas": json.dumps(said)})
    pq.write_table(table, place)


def _column(values: Array, feature: dict[str, Any]) -> Any:
    import pyarrow as pa

    kind = pa.float32() if feature["dtype"] == "float32" else pa.int64()
    if values.ndim == 1:
        return pa.array(values, type=kind)
    flat = pa.array(values.astype(np.float32).ravel(), type=kind)
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _statistics(values: Array) -> dict[str, list[float]]:
    rows = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    found = {"min": rows.min(0), "max": rows.max(0), "mean": rows.mean(0), "std": rows.std(0)}
    return {name: numbers.tolist() for name, numbers in found.items()} | {"count": [len(rows)]}
