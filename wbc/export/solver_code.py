"""The QP solver of an export: the static library of the casadi wheel, or the solver's own source."""

from __future__ import annotations

import hashlib
import html.parser
import io
import os
import pathlib
import tarfile
import urllib.error
import urllib.parse
import urllib.request

from wbc import validation
from wbc.errors import WbcError
from wbc.native import toolchain

#: The release whose headers are those of the casadi wheel, and the hash of its source archive
VERSION = "0.5.1"
SHA256 = "2e81a0bfa2f6e36e53c6fcc55d962c5b7f61d93a97909f6350c1fe26ce37af58"
ARCHIVE = f"daqp-{VERSION}.tar.gz"
#: Seconds until an index that does not answer counts as not there
PATIENCE = 30.0
#: No archive of this project is larger [bytes]
LARGEST = 1 << 22


class SolverSourceError(WbcError):
    """The solver's source cannot be had, or is not the pinned one."""


def from_wheel() -> dict[str, bytes]:
    """Headers, library and licence, by their place in the export.

    Raises:
        SolverSourceError: the casadi package has none for this platform.
    """
    headers, library = toolchain.headers() / "daqp", toolchain.library()
    licence = toolchain.headers() / "licenses" / "daqp-external" / "LICENSE"
    if not library.is_file():
        reason = "the casadi package has no static daqp library here; export with the solver's source"
        raise SolverSourceError("solver", str(library), reason)
    try:
        files = {f"daqp/include/daqp/{path.name}": path.read_bytes() for path in sorted(headers.glob("*.h"))}
        return files | {"daqp/libdaqp.a": library.read_bytes(), "daqp/LICENSE": licence.read_bytes()}
    except OSError as error:
        raise SolverSourceError("solver", error.filename, f"cannot be read: {error.strerror}") from error


def from_source(archive: str | os.PathLike[str] | None = None) -> dict[str, bytes]:
    """Headers, sources and licence of the pinned release, by their place in the export.

    Args:
        archive: its source archive on this machine; default: that of the package index, ``PIP_INDEX_URL`` or PyPI.

    Raises:
        SolverSourceError: it cannot be read or fetched, or its hash is another.
    """
    data = _read(validation.file_path("solver_source", archive)) if archive is not None else _fetch()
    found = hashlib.sha256(data).hexdigest()
    if found != SHA256:
        raise SolverSourceError("solver_source", found, f"the archive is not {ARCHIVE}, whose SHA-256 is {SHA256}")
    files: dict[str, bytes] = {}
    with tarfile.open(fileobj=io.BytesIO(data)) as opened:
        for member in opened.getmembers():
            place = _place(member.name)
            content = opened.extractfile(member) if place else None
            if content is not None:
                files[place] = content.read()
    return files


def _place(name: str) -> str:
    """Where a file of the archive goes; empty for those that are not needed."""
    parts = name.split("/")
    if parts[1:] == ["LICENSE"]:
        return "daqp/LICENSE"
    if parts[1:3] == ["csrc", "include"] and name.endswith(".h"):
        return f"daqp/include/daqp/{parts[-1]}"
    return f"daqp/src/{parts[-1]}" if parts[1:3] == ["csrc", "src"] and name.endswith(".c") else ""


def _read(path: pathlib.Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SolverSourceError("solver_source", str(path), f"cannot be read: {error.strerror}") from error


class _PageLinks(html.parser.HTMLParser):
    """Addresses that a page of an index names."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value for name, value in attrs if tag == "a" and name == "href" and value]


def _fetch() -> bytes:
    """The archive from the index."""
    index = os.environ.get("PIP_INDEX_URL") or "https://pypi.org/simple"
    page = f"{index.rstrip('/')}/daqp/"
    links = _PageLinks()
    links.feed(_get(page).decode(errors="replace"))
    for link in links.found:
        address = urllib.parse.urldefrag(urllib.parse.urljoin(page, link)).url
        if address.rsplit("/", 1)[-1] == ARCHIVE:
            return _get(address)
    raise SolverSourceError("solver_source", page, f"the index has no {ARCHIVE}")


def _get(address: str) -> bytes:
    try:
        with urllib.request.urlopen(address, timeout=PATIENCE) as answer:
            return bytes(answer.read(LARGEST))
    except (OSError, ValueError) as error:
        said = error.reason if isinstance(error, urllib.error.URLError) else error
        reason = f"cannot be fetched ({said}); download {ARCHIVE} elsewhere and give its path"
        raise SolverSourceError("solver_source", address, reason) from error
