"""Who is let in."""

from __future__ import annotations

import pytest
from websockets.datastructures import Headers
from websockets.http11 import Request

from wbc.viewer.gate import Gate


def request(path: str = "/", **headers: str) -> Request:
    return Request(path, Headers({name.replace("_", "-"): value for name, value in headers.items()}))


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "[::1]:8080", "localhost"])
def test_this_machine_is_let_in(host: str) -> None:
    gate = Gate(True, None)
    assert gate.refusal(request(Host=host)) == ""
    assert gate.refusal(request(Host=host, Origin=f"http://{host}")) == ""


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("127.0.0.1:8080", "http://evil.example"),
        ("127.0.0.1:8080", "http://127.0.0.1:9999"),
        ("127.0.0.1:8080", "null"),
        ("127.0.0.1:8080", ""),
        ("evil.example:8080", None),
        ("evil.example:8080", "http://evil.example:8080"),
        ("127.0.0.1.evil.example", None),
        ("", None),
    ],
)
def test_pages_of_others_are_not(host: str, origin: str | None) -> None:
    given = {} if origin is None else {"Origin": origin}
    assert Gate(True, None).refusal(request(Host=host, **given))


def test_elsewhere_the_token_is_asked_for() -> None:
    gate = Gate(False, "secret")
    assert gate.refusal(request("/", Host="robot:80"))
    assert gate.refusal(request("/?token=secre", Host="robot:80"))
    assert gate.refusal(request("/", Host="robot:80", Cookie="wbc_token=other"))
    assert gate.refusal(request("/", Host="robot:80", Cookie=";;;=== wbc_token"))
    assert gate.refusal(request("/?token=secret", Host="robot:80")) == ""
    assert gate.refusal(request("/scene/a", Host="robot:80", Cookie="x=1; wbc_token=secret")) == ""
    assert gate.refusal(request("/wbc", Host="robot:80", Authorization="Bearer secret")) == ""
    # The token does not open the door for pages of other sites
    assert gate.refusal(request("/wbc?token=secret", Host="robot:80", Origin="http://evil.example"))
    assert gate.cookie() == "wbc_token=secret; HttpOnly; SameSite=Strict; Path=/"
