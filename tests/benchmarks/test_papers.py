"""The table of the papers' sections names what is there, and every section."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8")

HARDT = (
    *(
        "1",
        "1.3",
        "1.4",
        "2.1",
        "2.2.1",
        "2.2.2",
        "2.2.3",
        "2.2.4",
        "3.1",
        "3.2",
        "3.3",
        "3.4",
        "3.4.1",
        "3.4.2",
    ),
    *(
        "3.4.3",
        "3.4.4",
        "3.5",
        "3.6",
        "4.1",
        "4.2",
        "4.3",
        "4.4",
        "4.4.1",
        "4.4.2",
        "5.1",
        "5.2",
        "5.3",
        "5.4",
    ),
    *(
        "5.5",
        "5.5.1",
        "5.5.2",
        "5.5.3",
        "5.5.4",
        "5.5.5",
        "5.5.6",
        "5.5.7",
        "5.5.8",
        "6",
        "6.1",
        "6.2",
        "6.2.1",
    ),
    *("6.2.2", "6.2.3", "6.3", "6.4", "7", "7.1", "8.1", "8.2", "8.3", "8.4", "9", "A", "B.1", "B.2", "B.3"),
    *("B.3.1", "B.3.2", "B.3.3", "B.3.4", "B.3.5", "B.4", *(f"B.4.{number}" for number in range(1, 11))),
)
KELLER = ("1", "2", "3", "3.1", "3.2", "4", "4.1", "4.2", "4.3", "5", "6")
GEORGE = (
    "Modification of an existing", "Redistribution of the energy", "A mathematical foundation",
    "The redistribution algorithm", "Positive and negative corrections", "partially converged solutions",
    "Algorithm", "Implementation", "Finding the patches in shadow", "Patch importance", "Interleaving",
    "Using a log to eliminate error", "Results", "Conclusion and future research",
)  # fmt: skip


def rows(paper: str) -> list[list[str]]:
    """Cells of the table under a heading."""
    part = re.split(r"^## ", TEXT, flags=re.MULTILINE)[1:]
    (table,) = (text for text in part if text.startswith(f"[{paper}]"))
    lines = [line for line in table.splitlines() if line.startswith("| ")][2:]
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines]


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`([\w./]+/[\w./]+\.\w+)`", TEXT))))
def test_what_is_named_exists(path: str) -> None:
    assert (ROOT / path).is_file()


@pytest.mark.parametrize("paper", ["H", "K", "G"])
def test_every_section_has_its_code_and_its_test(paper: str) -> None:
    for section, where, _, tested in rows(paper):
        assert re.search(r"`[\w./]+\.\w+`", where), section
        assert re.search(r"`tests/[\w./]+\.py`", tested), section


@pytest.mark.parametrize(("paper", "sections"), [("H", HARDT), ("K", KELLER)])
def test_no_numbered_section_is_missing(paper: str, sections: tuple[str, ...]) -> None:
    named = [section for section, *_ in rows(paper)]
    found = {number for name in named for number in re.findall(r"(?:^|, )([A-B1-9](?:\.\d+)*)(?= )", name)}
    assert set(sections) <= found, sorted(set(sections) - found)


def test_no_titled_section_is_missing() -> None:
    named = " | ".join(section for section, *_ in rows("G"))
    assert all(title in named for title in GEORGE)
