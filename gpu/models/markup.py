"""Reads XML into elements with their places, safely.

Python's own expat parses it, because expat reports where every element begins, in lines, columns
and bytes, which defusedxml and ElementTree do not. A document type is refused where it begins, so
there are no entities to expand and nothing to fetch. The size of a file and its nesting are
limited.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

from halfstep.errors import SceneError
from halfstep.models.source import ENOUGH_FAULTS, MOST_FAULTS, chunks_of, others
from halfstep.scene.faults import show

MAX_NESTING = 64
# Limits against files that take much more memory or time than a model of their size.
MAX_ELEMENTS = 1 << 20
MAX_TAG_BYTES = 1 << 22
MAX_ATTRIBUTES = 64
_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
# A tag, and what may stand between it and its text.
_BEFORE_TEXT = re.compile(_TAG.pattern + rb"(?:\s|<!--.*?-->|<\?.*?\?>)*", re.DOTALL)
_WORD_END = re.compile(r"\s|$")
_BLANKS = bytes.maketrans(b"\t\r\n", b"   ")
_NONE: Mapping[str, str] = {}


@dataclass(slots=True)
class Element:
    """An element of a document.

    Attributes:
        name: name of its tag.
        attributes: its attributes by name.
        at: index of its first byte in the document.
        children: its child elements in order.
        text: all text in it, without blanks around it and without the text of its children.
    """

    name: str
    attributes: Mapping[str, str]
    at: int
    children: Sequence[Element] = ()
    text: str = ""
    _firsts: dict[str, Element] | None = None

    def find_all(self, *names: str) -> Iterator[Element]:
        """The children that have one of ``names``."""
        return (child for child in self.children if child.name in names)

    def find(self, name: str) -> Element | None:
        """The first child that has a name; None if there is none."""
        if self._firsts is None:
            self._firsts = {child.name: child for child in reversed(self.children)}
        return self._firsts.get(name)


class Value(NamedTuple):
    """The value of a key of an element: an attribute, or the text of a child.

    Attributes:
        key: name of the key.
        text: the value without blanks around it.
        element: the element that has the key.
        holder: the child that has the text; None for an attribute.
    """

    key: str
    text: str
    element: Element
    holder: Element | None


class Document:
    """A document, and the faults found in it so far.

    Attributes:
        name: name of the file, for people.
        root: the outermost element.
    """

    def __init__(self, name: str, content: bytearray, root: Element) -> None:
        self.name, self.root = name, root
        self._content = content
        self._faults: dict[tuple[int, str], None] = {}

    @staticmethod
    def value(element: Element, key: str) -> Value | None:
        """The value of a key, which is an attribute or a child; None if it is missing."""
        text = element.attributes.get(key)
        if text is not None:
            return Value(key, text.strip(), element, None)
        child = element.find(key) if element.children else None
        return None if child is None else Value(key, child.text, element, child)

    def fault(self, where: Element | Value, what: str, column: int = 0) -> None:
        """Record a fault of an element or a value.

        Args:
            where: the element, or the value of a key.
            what: the fault; the message puts the names of element and key before it.
            column: index of the faulty character in the value.

        Raises:
            SceneError: so many faults were found that reading ends.
        """
        if isinstance(where, Value):
            at = self._place(where, column)
            what = f"{titled(where.element)}: {where.key}: {what}"
        else:
            at, what = where.at, f"{titled(where)}: {what}"
        self._faults[at, what] = None
        if len(self._faults) == ENOUGH_FAULTS:
            self.check()

    def _place(self, value: Value, column: int) -> int:
        """The index of the byte where a character of a value stands, or where its holder begins."""
        holder = value.holder
        if holder is None:
            text, at = value.element.attributes[value.key], value.element.at
            pattern = rb"""\s%s\s*=\s*["']""" % re.escape(value.key.encode())
            tag = _TAG.match(self._content, at)
            end = at if tag is None else tag.end()
            found = re.compile(pattern).search(self._content, at, end)
            at = found.end() if found else at
        else:
            text, at = holder.text, holder.at
            before = _BEFORE_TEXT.match(self._content, at) if text else None
            at = before.end() if before else at
        # Only up to the end of the word must the document have the text as it is, unescaped.
        begin = len(text) - len(text.lstrip()) + column
        word = _WORD_END.search(text, begin)
        assert word is not None
        raw = text[: word.start()].encode()
        there = self._content[at : at + len(raw)]
        # XML turns line ends in an attribute into blanks.
        is_plain = b"&" not in there and there.translate(_BLANKS) == raw.translate(_BLANKS)
        return at + len(text[:begin].encode()) if is_plain else at

    def check(self) -> None:
        """Raise a `SceneError` with all recorded faults, if there are any."""
        found = sorted(self._faults)
        if not found:
            return
        lines: list[str] = []
        # The text up to a fault in the line of the fault, and the lines before.
        begun, before, ends = "", 0, 0
        for at, what in found[:MOST_FAULTS]:
            begun += self._content[before:at].decode(errors="replace")
            before, ends = at, ends + begun.count("\n")
            begun = begun.rpartition("\n")[2]
            where = f"line {ends + 1}, column {len(begun) + 1}"
            lines.append(f"{self.name}: {where}: {what}")
        raise SceneError(*lines, *others(self.name, len(found)))


def titled(element: Element) -> str:
    """The title of an element, for people: ``cell 7``."""
    number = element.attributes.get("id")
    if number is None:
        child = element.find("id")
        number = "" if child is None else child.text
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
    builder = _Builder(path.name)
    # Elements have no cycles, so the search for cycles only takes time.
    is_searching = gc.isenabled()
    gc.disable()
    try:
        for chunk in chunks_of(path, given):
            content += chunk
            builder.feed(chunk, len(content))
        return Document(path.name, content, builder.end(len(content)))
    finally:
        if is_searching:
            gc.enable()


class _Builder:
    """Builds elements from expat's events."""

    def __init__(self, name: str) -> None:
        self._name = name
        # For each element that is open: the element, its children and its text.
        self._open: list[tuple[Element, list[Element], list[str]]] = []
        self._root: Element | None = None
        self._count = 0
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def feed(self, data: bytes, fed: int, *, is_last: bool = False) -> None:
        """Parse the next bytes of a file, with which ``fed`` bytes of it are parsed."""
        try:
            self._parser.Parse(data, is_last)
        except expat.ExpatError as error:
            where = f"line {error.lineno}, column {error.offset + 1}"
            inside = f", in {titled(self._open[-1][0])}" if self._open else ""
            what = expat.ErrorString(error.code)
            raise SceneError(f"{self._name}: {where}: not XML: {what}{inside}") from None
        except (ValueError, LookupError) as error:
            # The encoding is unknown, or one with several bytes for a letter.
            raise SceneError(f"{self._name}: line 1, column 1: {error}") from None
        # Expat reads an unfinished tag or comment again with every call.
        if not is_last and fed - self._parser.CurrentByteIndex > MAX_TAG_BYTES:
            self._refuse(f"a tag or a comment is longer than {MAX_TAG_BYTES >> 20} MiB")

    def end(self, fed: int) -> Element:
        self.feed(b"", fed, is_last=True)
        assert self._root is not None
        return self._root

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MAX_ELEMENTS:
            self._refuse(f"has more than {MAX_ELEMENTS} elements")
        if len(attributes) > MAX_ATTRIBUTES:
            self._refuse(f"{show(name)} has more than {MAX_ATTRIBUTES} attributes")
        if len(self._open) == MAX_NESTING:
            self._refuse(f"{show(name)} lies in more than {MAX_NESTING} elements")
        element = Element(name, attributes or _NONE, self._parser.CurrentByteIndex)
        if self._open:
            self._open[-1][1].append(element)
        else:
            self._root = element
        self._open.append((element, [], []))

    def _end(self, _name: str) -> None:
        element, children, texts = self._open.pop()
        if children:
            element.children = children
        if texts:
            element.text = "".join(texts).strip()

    def _characters(self, text: str) -> None:
        texts = self._open[-1][2]
        # Nearly all text stands between elements, and is blank.
        if texts or not text.isspace():
            texts.append(text)

    def _doctype(self, name: str, *_: object) -> None:
        self._refuse(f"has a document type, {show(name)}; only files without one are read")

    def _refuse(self, what: str) -> NoReturn:
        where = f"line {self._parser.CurrentLineNumber}, "
        where += f"column {self._parser.CurrentColumnNumber + 1}"
        raise SceneError(f"{self._name}: {where}: {what}")
