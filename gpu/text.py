"""Text files that people write: decodes UTF-8, and names lines and columns."""

from __future__ import annotations

import codecs


def decoded(content: bytes) -> str:
    """The text of a UTF-8 file, without the byte order mark with which some editors begin a file.

    Raises:
        ValueError: ``line 2, column 10: not UTF-8 text``.
    """
    content = content.removeprefix(codecs.BOM_UTF8)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        before = content[: error.start].decode("utf-8")
        raise ValueError(f"{place(before)}: not UTF-8 text") from None


def place(before: str) -> str:
    """Line and column, counted from 1, of the character that follows the text ``before``."""
    last = before.rsplit("\n", 1)[-1]
    return f"line {before.count(chr(10)) + 1}, column {len(last) + 1}"
