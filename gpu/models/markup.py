"""Reads XML into elements with their places, safely.

Python's own expat parses it, because expat reports where every element begins, in lines, columns
and bytes, which defusedxml and ElementTree do not. A document type is refused where it begins, so
there are no entities to expand and nothing to fetch. The size of a file and its nesting are
limited.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from halfstep.errors import SceneError
from halfstep.models.source import MAX_BYTES
from halfstep.scene.faults import show
from halfstep.text import place

MAX_NESTING = 64
_CHUNK = 1 << 20
# The most faults that a message lists.
_MOST_FAULTS = 50


@dataclass(slots=True)
class Element:
    """An element of a document.

    Attributes:
        name: name of its tag.
        attributes: its attributes by name.
        at: index of its first byte in the document.
        children: its child elements in order.
        text: all text in it, without the text of its children.
        text_at: index of the first byte of the text, after blanks; -1 if there is no text.
    """

    name: str
    attributes: dict[str, str]
    at: int
    children: list[Element] = field(default_factory=list)
    text: str = ""
    text_at: int = -1

    def find_all(self, *names: str) -> Iterator[Element]:
        """The children that have one of ``names``."""
        return (child for child in self.children if child.name in names)


@dataclass(frozen=True, slots=True)
class Value:
    """The value of a key of an element: an attribute, or the text of a child.

    Attributes:
        key: name of the key.
        text: the value without blanks around it.
        element: the element that has the key.
        at: index of the byte of the document where the text begins, or where its holder begins.
        is_plain: whether the document has each character of the text unescaped.
    """

    key: str
    text: str
    element: Element
    at: int
    is_plain: bool


class Document:
    """A document, and the faults found in it so far.

    Attributes:
        name: name of the file, for people.
        root: the outermost element.
    """

    def __init__(self, name: str, content: bytes, root: Element) -> None:
        self.name, self.root = name, root
        self._content = content
        self._faults: dict[tuple[int, str], None] = {}

    def value(self, element: Element, key: str) -> Value | None:
        """The value of a key, which is an attribute or a child; None if it is missing."""
        if key in element.attributes:
            text = element.attributes[key]
            pattern = rb"""\s%s\s*=\s*(["'])""" % re.escape(key.encode())
            match = re.compile(pattern).search(self._content, element.at)
            return self._value(key, text, element, match.end() if match else element.at)
        for child in element.find_all(key):
            at = child.at if child.text_at < 0 else child.text_at
            return self._value(key, child.text, element, at)
        return None

    def _value(self, key: str, text: str, element: Element, at: int) -> Value:
        raw = text.encode()
        there = self._content[at : at + len(raw)]
        # XML turns line ends in an attribute into blanks.
        is_plain = there.split() == raw.split() and len(there) == len(raw)
        start = len(text) - len(text.lstrip())
        at += len(text[:start].encode()) if is_plain else 0
        return Value(key, text.strip(), element, at, is_plain)

    def fault(self, where: Element | Value, what: str, column: int = 0) -> None:
        """Record a fault of an element or a value.

        Args:
            where: the element, or the value of a key.
            what: the fault; the message puts the names of element and key before it.
            column: index of the faulty character in the value.
        """
        if isinstance(where, Value):
            at = where.at
            if where.is_plain:
                at += len(where.text[:column].encode())
            what = f"{titled(where.element)}: {where.key}: {what}"
        else:
            at, what = where.at, f"{titled(where)}: {what}"
        self._faults[at, what] = None

    def check(self) -> None:
        """Raise a `SceneError` with all recorded faults, if there are any."""
        found = sorted(self._faults)
        if not found:
            return
        lines = [f"{self.name}: {self._place(at)}: {what}" for at, what in found[:_MOST_FAULTS]]
        if len(found) > _MOST_FAULTS:
            lines.append(f"{self.name}: {len(found) - _MOST_FAULTS} more faults")
        raise SceneError(*lines)

    def _place(self, at: int) -> str:
        return place(self._content[:at].decode(errors="replace"))


def titled(element: Element) -> str:
    """The title of an element, for people: ``cell 7``."""
    number = element.attributes.get("id")
    if number is None:
        number = next((child.text for child in element.find_all("id")), "")
    return f"{element.name} {number.strip()[:20]}".strip()


def read(path: Path, given: str) -> Document:
    """Read the document in a file.

    Args:
        path: path of the file.
        given: name of the file in messages.

    Raises:
        SceneError: the file cannot be read, is not XML, is too large or too deeply nested, or has
            a document type.
    """
    content = bytearray()
    try:
        with path.open("rb") as file:
            builder = _Builder(path.name)
            if os.fstat(file.fileno()).st_size > MAX_BYTES:
                raise SceneError(f"{path.name}: larger than {MAX_BYTES >> 20} MiB")
            while chunk := file.read(_CHUNK):
                content += chunk
                builder.feed(chunk)
            root = builder.end()
    except FileNotFoundError:
        raise SceneError(f"{given}: no such file") from None
    except OSError as error:
        raise SceneError(f"{given}: cannot be read: {error.strerror}") from None
    return Document(path.name, bytes(content), root)


class _Builder:
    """Builds elements from expat's events."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._open: list[Element] = []
        self._texts: list[list[str]] = []
        self._root: Element | None = None
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def feed(self, data: bytes, *, is_last: bool = False) -> None:
        try:
            self._parser.Parse(data, is_last)
        except expat.ExpatError as error:
            where = f"line {error.lineno}, column {error.offset + 1}"
            inside = f", in {titled(self._open[-1])}" if self._open else ""
            what = expat.ErrorString(error.code)
            raise SceneError(f"{self._name}: {where}: not XML: {what}{inside}") from None
        except (ValueError, LookupError) as error:
            # The encoding is unknown, or one with several bytes for a letter.
            raise SceneError(f"{self._name}: line 1, column 1: {error}") from None

    def end(self) -> Element:
        self.feed(b"", is_last=True)
        assert self._root is not None
        return self._root

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        element = Element(name, attributes, self._parser.CurrentByteIndex)
        if len(self._open) == MAX_NESTING:
            self._refuse(f"{show(name)} lies in more than {MAX_NESTING} elements")
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)
        self._texts.append([])

    def _end(self, _name: str) -> None:
        self._open.pop().text = "".join(self._texts.pop())

    def _characters(self, text: str) -> None:
        element, texts = self._open[-1], self._texts[-1]
        if element.text_at < 0:
            # The text of an element usually begins with a line end, which is skipped.
            begun = text.lstrip()
            if not begun:
                return
            blanks = len(text[: len(text) - len(begun)].encode())
            element.text_at, text = self._parser.CurrentByteIndex + blanks, begun
        texts.append(text)

    def _doctype(self, name: str, *_: object) -> None:
        self._refuse(f"has a document type, {show(name)}; only files without one are read")

    def _refuse(self, what: str) -> NoReturn:
        where = f"line {self._parser.CurrentLineNumber}, "
        where += f"column {self._parser.CurrentColumnNumber + 1}"
        raise SceneError(f"{self._name}: {where}: {what}")
