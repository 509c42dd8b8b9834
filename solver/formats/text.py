"""Files of lines: decoded, split into words, and numbers read with the line that holds them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from solver.errors import SceneError

_MOST_WORDS: Final = 100_000
"""Of one line."""

_NAMING: Final = {"usemtl", "newmtl", "mtllib", "map_kd", "o", "g", "solid", "m", "v", "c"}
"""Words that names follow."""


def decoded(content: bytes) -> str:
    """The text of a file, whatever names in it are encoded by. Raises SceneError for binary data."""
    if b"\0" in content:
        raise SceneError("this is not text")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def numbered_lines(content: bytes) -> Iterator[tuple[int, list[str]]]:
    """Words of the lines that have any, with the number of the line from 1.

    Comments are left out, and a line that ends in a backslash goes on in the next. Raises SceneError.
    """
    words: list[str] = []
    first = 0
    for number, line in enumerate(decoded(content).splitlines(), start=1):
        plain = line.rstrip()
        goes_on = plain.endswith("\\")
        first = first or number
        words = _said([*words, *plain.removesuffix("\\").split()])
        if len(words) > _MOST_WORDS:
            raise SceneError(f"a line of more than {_MOST_WORDS} words", ("line", first))
        if goes_on:
            continue
        if words:
            yield first, words
        words, first = [], 0
    if words:
        yield first, words


def _said(words: list[str]) -> list[str]:
    """`words` without a comment: it begins with #, which a name may hold, and the words of a name too."""
    names = bool(words) and words[0].lower() in _NAMING
    for k, word in enumerate(words):
        if word == "#" or (word.startswith("#") and (k == 0 or not names)):
            return words[:k]
    return words


def number_of(word: str, line: int) -> float:
    """The finite number that a word is. Raises SceneError."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneError(f"{word[:40]!r} is not a number", ("line", line))
    return value


def numbers_of(words: Sequence[str], line: int, count: int) -> list[float]:
    """The first `count` of `words` as numbers. Raises SceneError where there are fewer."""
    if len(words) < count:
        raise SceneError(f"{count} numbers are needed, and there are {len(words)}", ("line", line))
    return [number_of(word, line) for word in words[:count]]


def integer_of(word: str, line: int) -> int:
    """The whole number that a word is. Raises SceneError."""
    try:
        return int(word)
    except ValueError:
        raise SceneError(f"{word[:40]!r} is not a whole number", ("line", line)) from None
