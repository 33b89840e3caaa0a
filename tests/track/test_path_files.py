"""Path files: the three kinds say the same, and what is wrong in them is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError
from wbc.track.path_file import PathFileError, read_path

ROWS = [
    (0.0, 0.4, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0),
    (1.0, 0.5, 0.1, 0.5, 0.9238795, 0.3826834, 0.0, 0.0),
    (2.5, 0.5, 0.2, 0.4, 0.7071068, 0.7071068, 0.0, 0.0),
]
HEAD = "t,x,y,z,qx,qy,qz,qw"


def csv_text(rows: list[tuple[float, ...]] = ROWS, head: str = HEAD) -> str:
    return "\n".join([head, *(",".join(str(x) for x in row) for row in rows)]) + "\n"


def waypoints() -> list[dict[str, object]]:
    return [{"t": r[0], "position": list(r[1:4]), "quaternion": list(r[4:])} for r in ROWS]


def toml_text() -> str:
    out = []
    for row in ROWS:
        out.append(f"[[waypoints]]\nt = {row[0]}\nposition = {list(row[1:4])}\nquaternion = {list(row[4:])}\n")
    return "\n".join(out)


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_all_kinds_of_files_agree(tmp_path: Path) -> None:
    mixed = [(r[7], *r[:7]) for r in ROWS]
    files = [
        write(tmp_path, "a.csv", csv_text()),
        write(tmp_path, "b.csv", "# made by hand\n\n" + csv_text(mixed, "qw,t,x,y,z,qx,qy,qz")),
        write(tmp_path, "c.json", json.dumps({"waypoints": waypoints()})),
        write(tmp_path, "d.json", json.dumps(waypoints())),
        write(tmp_path, "e.TOML", toml_text()),
    ]
    paths = [read_path(file) for file in files]
    for path in paths:
        assert path.duration == 2.5
        for t in (0.0, 0.7, 1.9):
            np.testing.assert_allclose(path.sample(t).pose.homogeneous, paths[0].sample(t).pose.homogeneous, atol=1e-12)
    np.testing.assert_allclose(paths[0].sample(1.0).pose.translation, ROWS[1][1:4], atol=1e-12)


def changed(row: int, column: int, value: object) -> str:
    rows = [list(r) for r in ROWS]
    rows[row][column] = value  # type: ignore[call-overload]
    return csv_text(rows)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "text", "error", "message"),
    [
        ("a.csv", csv_text(head="t,x,y,z,qx,qy,qz,gw"), UnknownNameError, "did you mean 'qw'"),
        ("a.csv", "t,x,y,z,qx,qy,qz\n0,0,0,0,0,0,1\n", ShapeError, "missing qw"),
        ("a.csv", csv_text(head="t,t,y,z,qx,qy,qz,qw"), ShapeError, "missing x"),
        ("a.csv", HEAD + ",x\n", ShapeError, "twice"),
        ("a.csv", csv_text() + "3,1,2\n", ShapeError, "line 5: expected 8 values"),
        ("a.csv", changed(1, 2, "north"), ShapeError, "line 3: expected numbers"),
        ("a.csv", changed(1, 2, "nan"), NotFiniteError, "line 3"),
        ("a.csv", changed(2, 7, 0.5), RotationError, "line 4: quaternion of norm"),
        ("a.csv", changed(2, 0, 0.5), RangeError, r"times\[2\]"),
        ("a.csv", "", PathFileError, "empty"),
        ("a.csv", csv_text(ROWS[:1]), PathFileError, "at least two waypoints, found 1"),
        ("a.json", "{", PathFileError, "not well formed"),
        ("a.json", '{"points": []}', UnknownNameError, "did you mean 'waypoints'"),
        ("a.json", '{"waypoints": 3}', ShapeError, "list of tables"),
        ("a.json", '[{"t": 0, "position": [0, 0, 0]}]', ShapeError, "missing quaternion"),
        ("a.json", '[{"t": 0, "pos": [0, 0, 0]}]', UnknownNameError, "did you mean 'position'"),
        ("a.json", "[3]", ShapeError, "waypoint 0"),
        ("a.json", '[{"t": 0, "position": [0, 0], "quaternion": [0, 0, 0, 1]}]', ShapeError, r"waypoint 0.position"),
        ("a.toml", "t = = 3", PathFileError, "not well formed"),
        ("a.xlsx", "", PathFileError, r"unknown kind of file.*\.csv, \.json, \.toml"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, name: str, text: str, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read_path(write(tmp_path, name, text))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(PathFileError, match="no such file"):
        read_path(tmp_path / "none.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(PathFileError, match="cannot be read"):
        read_path(tmp_path / "folder.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(PathFileError, match="cannot be read"):
        read_path(tmp_path / "binary.csv")
