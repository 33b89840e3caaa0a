"""Requests: parsed once, with typed errors, and the same again from the log of their run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.errors import RangeError, ShapeError, StructureFileError, UnknownNameError, WbcError
from wbc.robots import WalkerData, walker
from wbc.walking import plane, save_structure
from wbc.walking.log.folder import machine_made
from wbc.walking.log.log import WalkLogError
from wbc.walking.planner import plan_walk
from wbc.walking.run import ArmRequest, DriveRequest, GridPlace, PathRequest, ResumeRequest, Site
from wbc.walking.run.records import record_of, request_of
from wbc.walking.run.request import PublishedRequest, Request
from wbc.walking.run.session import mode_of

REQUESTS = [
    PathRequest(),
    PathRequest(Site(rows="12-14", fraction=0.1, seed=3, rigid=True), "13,9,10", ("13,13", "14,14,-5"), 0.2, 0.1),
    PathRequest("plane", objective="destination", free_start=True),
    PathRequest("truss", "L2,6", ("L2,8",), plan="plan.json"),
    PublishedRequest(start="13,9"),
    DriveRequest(start="13,11", commands="keyboard"),
    DriveRequest("holds.csv", "hold 7", commands="rates.csv"),
    ArmRequest(arm="arm2", tasks=("hold 13,12", "rate 0,0,-0.05,0,0,0.1 for 2")),  # type: ignore[arg-type]
]


@pytest.mark.parametrize("request_", REQUESTS)
def test_a_request_is_the_same_from_its_record(request_: Request) -> None:
    record = json.loads(json.dumps(record_of(request_)))
    again = request_of(record)
    assert again == request_
    assert type(again) is type(request_)


def test_poses_of_a_file_are_in_the_record(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text("x,y,z,ax,ay,az,rx,ry,rz\n1,2,3,0,0,-1,1,0,0\n")
    request = ArmRequest(tasks=(f"poses {file}",))  # type: ignore[arg-type]
    file.unlink()
    again = request_of(json.loads(json.dumps(record_of(request))))
    assert again == request
    assert isinstance(again, ArmRequest)
    assert again.tasks[0].poses[0][:3] == (1.0, 2.0, 3.0)


def test_texts_are_parsed_once() -> None:
    request = PathRequest(start="13,9,90", points=("13,13",))
    assert request.start == GridPlace(13.0, 9.0, np.pi / 2)
    assert request.points == (GridPlace(13.0, 13.0),)
    assert PathRequest(start=request.start, points=request.points) == request
    assert PathRequest(start=(13, 9, np.pi / 2), points=((13, 13),)) == request  # type: ignore[arg-type]
    assert PathRequest("plane").points == ("8,17",)


@pytest.mark.parametrize(
    "record",
    [
        None,
        3,
        {"start": "13,9", "mode": "velocity"},
        {"kind": "fly"},
        {"kind": "path"},
        {"speed": "fast"},
        {"kind": "path", "site": {"hue": 1}},
    ],
)
def test_what_is_no_record_is_refused(record: object) -> None:
    with pytest.raises(WalkLogError, match="what the run was asked to do"):
        request_of(record)


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda: PathRequest("holds.csv"), StructureFileError, "holds.csv"),
        (lambda: PathRequest(start="13"), ShapeError, "T,A"),
        (lambda: PathRequest(points=("13,99",)), RangeError, r"place 2\.A"),
        (lambda: PathRequest("plane", points=(3,)), ShapeError, "place 2"),
        (lambda: PathRequest(site=3), ShapeError, "site"),
        (lambda: PathRequest(objective="fast"), UnknownNameError, "objective"),
        (lambda: PathRequest(speed=0.0), RangeError, "speed"),
        (lambda: PublishedRequest("plane"), RangeError, "cylinder"),
        (ArmRequest, RangeError, "do"),
        (lambda: ArmRequest(tasks=("jump",)), ShapeError, "hold ID"),
        (lambda: ResumeRequest("run", "late"), ShapeError, "time in s"),  # type: ignore[arg-type]
    ],
)
def test_bad_requests_are_named(make: Any, error: type[WbcError], match: str) -> None:
    with pytest.raises(error, match=match):
        make()


def test_a_file_has_no_ends_of_its_own(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="no ends of its own"):
        PathRequest(str(save_structure(plane(), tmp_path / "mine.csv")))


def test_the_two_ended_arm_is_sent_to_climb() -> None:
    arm, command = walker(two_ended=True), "wbc climb --robot two_ended"
    refused: list[Callable[[], object]] = [
        lambda: mode_of(PathRequest(), arm),
        lambda: mode_of(DriveRequest(), arm),
        lambda: plan_walk(arm, plane(), PathRequest("plane").path(WalkerData.read())),
    ]
    for ask in refused:
        with pytest.raises(ShapeError, match=command):
            ask()
    with pytest.raises(WalkLogError, match=command):
        machine_made({"two_ended": True, "arms": 2, "data": {}})


def test_modes_refuse_what_they_do_not_do(machine: Any) -> None:
    with pytest.raises(RangeError, match="only walks along a path ask"):
        mode_of(DriveRequest(), machine, ask=lambda step, refused: "")
    with pytest.raises(RangeError, match="driven"):
        mode_of(PathRequest(), machine, commands=object())  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="request"):
        mode_of(PublishedRequest(), machine)
    with pytest.raises(UnknownNameError, match="13,99"):
        mode_of(ArmRequest(tasks=("hold 13,99",)), machine)  # type: ignore[arg-type]
