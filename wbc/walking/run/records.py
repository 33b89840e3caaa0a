"""Requests as plain data, for the logs of their runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

from wbc.errors import WbcError
from wbc.walking.log.log import WalkLogError
from wbc.walking.run.request import (
    ArmRequest,
    ArmTask,
    DriveRequest,
    PathRequest,
    PublishedRequest,
    Request,
    Site,
)

#: Names of the modes in records
KINDS: Mapping[str, type[Any]] = {
    "path": PathRequest,
    "published": PublishedRequest,
    "drive": DriveRequest,
    "arm": ArmRequest,
}


def record_of(request: Request) -> dict[str, Any]:
    """A request as plain data, for the log of its run; :func:`request_of` reads it."""
    kind = next(name for name, cls in KINDS.items() if type(request) is cls)
    return {"kind": kind, **asdict(request)}


def request_of(record: Any) -> Request:
    """The request of a log: what :func:`record_of` made.

    Raises:
        WalkLogError: it is none.
    """
    try:
        values = dict(record)
        kind = KINDS[values.pop("kind")]
        known = {field.name for field in fields(kind)}
        if values.keys() - known:
            raise KeyError(min(values.keys() - known))
        values["site"] = Site(**values["site"])
        if "tasks" in values:
            values["tasks"] = tuple(_task(**task) for task in values["tasks"])
        request: Request = kind(**values)
        return request
    except (KeyError, TypeError, ValueError, WbcError) as error:
        reason = f"the log does not say what the run was asked to do: {error}"
        raise WalkLogError("request", type(record).__name__, reason) from error


def _task(**values: Any) -> ArmTask:
    values["poses"] = tuple(tuple(float(x) for x in pose) for pose in values["poses"])
    return ArmTask(**{**values, "twist": tuple(values["twist"])})
