"""Requests: parsed once, with typed errors, and the same again from the log of their run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.errors import RangeError, ShapeError, StructureFileError, UnknownNameError, WbcError
from wbc.walking.log.log import WalkLogError
from wbc.walking.run import ArmRequest, DriveRequest, GridPlace, PathRequest, ResumeRequest, Site, TwoEndedRequest
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
    TwoEndedRequest(),
    TwoEndedRequest(goal=(14.0, 0.0, 4.0), gait="inchworm"),
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
        (lambda: PathRequest("grapples"), ShapeError, "no ends of its own"),
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
        (lambda: TwoEndedRequest(start=("1",)), ShapeError, "two holds"),
        (lambda: TwoEndedRequest(goal=(1.0, 2.0)), ShapeError, "to"),
        (lambda: TwoEndedRequest(gait="gallop"), UnknownNameError, "gait"),
        (lambda: ResumeRequest("run", "late"), ShapeError, "time in s"),  # type: ignore[arg-type]
    ],
)
def test_bad_requests_are_named(make: Any, error: type[WbcError], match: str) -> None:
    with pytest.raises(error, match=match):
        make()


def test_a_goal_of_the_two_ended_arm_is_a_hold_or_a_place() -> None:
    assert TwoEndedRequest(goal="4").to() == TwoEndedRequest(goal="4")
    assert TwoEndedRequest().to(("14,0,4",)) == TwoEndedRequest(goal=(14.0, 0.0, 4.0))
    for goals in (("9",), ("1,2",), ("3", "4")):
        with pytest.raises((UnknownNameError, ShapeError)):
            TwoEndedRequest().to(goals)
    with pytest.raises(UnknownNameError, match="'9'"):
        TwoEndedRequest(start=("1", "9")).to()


def test_modes_refuse_what_they_do_not_do(machine: Any) -> None:
    with pytest.raises(RangeError, match="only walks along a path ask"):
        mode_of(DriveRequest(), machine, ask=lambda step, refused: "")
    with pytest.raises(RangeError, match="driven"):
        mode_of(PathRequest(), machine, commands=object())  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="request"):
        mode_of(PublishedRequest(), machine)
    with pytest.raises(ShapeError, match="two-ended arm"):
        mode_of(TwoEndedRequest(), machine)
    with pytest.raises(UnknownNameError, match="13,99"):
        mode_of(ArmRequest(tasks=("hold 13,99",)), machine)  # type: ignore[arg-type]
