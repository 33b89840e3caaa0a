"""XML as tinyxml2 reads it, which urdfdom and MuJoCo use, so that files that work there are read here too.

Prefixes need no declaration, and namespaces are nothing but attributes; a declaration may come after blank lines, an
encoding in it is not believed; an ampersand that begins no entity stands for itself; comments may hold ``--``. Of
entities only ``&lt;``, ``&gt;``, ``&amp;``, ``&quot;``, ``&apos;`` and numbers are replaced: a file defines none, and
nothing in it makes this program read another file.
"""

from __future__ import annotations

import contextlib
import functools
import re
import xml.etree.ElementTree as ElementTree

#: Deepest nesting, as of tinyxml2
DEEPEST = 500

#: What a robot description begins with
ROOTS = ("robot", "mujoco", "sdf")
_COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_NAME = r"[A-Za-z_:\u0080-\U0010ffff][\w:.\-\u0080-\U0010ffff]*"
_ENTITY = re.compile(r"&(?:#(\d{1,7})|#x([0-9a-fA-F]{1,6})|(lt|gt|amp|quot|apos));")
_NAMED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}


@functools.cache
def _patterns() -> tuple[re.Pattern[str], re.Pattern[str]]:
    """Of a token and of an attribute; made when a file needs them, as that takes as long as reading some files."""
    token = rf"""<!--.*?-->|<\?.*?\?>|<!\[CDATA\[(?P<data>.*?)\]\]>|<!(?!--|\[CDATA\[)[^>]*>
    |<\s*/(?P<end>{_NAME})\s*>
    |<\s*(?P<start>{_NAME})(?P<attributes>(?:\s*{_NAME}\s*=\s*(?:"[^"]*"|'[^']*'))*)\s*(?P<empty>/?)>
    |(?P<text>[^<]+)"""
    attribute = rf"""({_NAME})\s*=\s*(?:"([^"]*)"|'([^']*)')"""
    return re.compile(token, re.DOTALL | re.VERBOSE | re.ASCII), re.compile(attribute, re.ASCII)


def parse(text: str) -> ElementTree.Element:
    """The root element: the first of :data:`ROOTS` where there are several.

    Raises:
        ElementTree.ParseError: what tinyxml2 refuses, with the line.
    """
    if "<!" not in _COMMENT.sub("", text):
        # Python's own parser is four times as fast where it reads a file alike
        with contextlib.suppress(ElementTree.ParseError):
            root = ElementTree.fromstring(text.encode(), ElementTree.XMLParser(encoding="utf-8"))
            if root.tag in ROOTS:
                return root
    return _parse(text)


def _parse(text: str) -> ElementTree.Element:
    roots: list[ElementTree.Element] = []
    opened: list[ElementTree.Element] = []
    at, text = 0, text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    while at < len(text):
        token = _patterns()[0].match(text, at)
        if token is None:
            raise _error("no tag, comment or text begins here", text, at)
        if token["start"]:
            element = ElementTree.Element(token["start"], _attributes(token["attributes"], text, at))
            if opened:
                opened[-1].append(element)
            else:
                roots.append(element)
            if not token["empty"]:
                opened.append(element)
            if len(opened) > DEEPEST:
                raise _error(f"more than {DEEPEST} elements within each other", text, at)
        elif token["end"]:
            if not opened or opened[-1].tag != token["end"]:
                due = f"</{opened[-1].tag}>" if opened else "nothing"
                raise _error(f"</{token['end']}> where {due} was due", text, at)
            opened.pop()
        elif opened and (words := token["data"] or _replaced(token["text"] or "")):
            _append(opened[-1], words)
        at = token.end()
    if opened:
        raise _error(f"<{opened[-1].tag}> is not closed", text, at)
    if not roots:
        raise _error("no element", text, at)
    return next((root for root in roots if root.tag in ROOTS), roots[0])


def _attributes(text: str, whole: str, at: int) -> dict[str, str]:
    out: dict[str, str] = {}
    for name, double, single in _patterns()[1].findall(text):
        if name in out:
            raise _error(f"attribute {name} twice", whole, at)
        out[name] = _replaced(double or single)
    return out


def _append(element: ElementTree.Element, words: str) -> None:
    if len(element):
        element[-1].tail = (element[-1].tail or "") + words
    else:
        element.text = (element.text or "") + words


def _replaced(text: str) -> str:
    """The text with the entities that every file has."""

    def character(entity: re.Match[str]) -> str:
        if entity[3]:
            return _NAMED[entity[3]]
        code = int(entity[1]) if entity[1] else int(entity[2], 16)
        return chr(code) if 0 < code < 0x110000 and not 0xD800 <= code < 0xE000 else entity[0]

    return _ENTITY.sub(character, text)


def _error(reason: str, text: str, at: int) -> ElementTree.ParseError:
    line = text.count("\n", 0, at) + 1
    return ElementTree.ParseError(f"{reason}: line {line}, column {at - text.rfind(chr(10), 0, at)}")
