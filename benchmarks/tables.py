"""What a measurement comes to: a table with its targets, and the ways to show it."""

from __future__ import annotations

from dataclasses import dataclass

from rich.table import Table as RichTable
from rich.text import Text


@dataclass(frozen=True)
class Target:
    """A figure that is to be reached."""

    what: str
    value: float
    bound: float
    unit: str = ""
    at_most: bool = True
    """Whether the value may not be above the bound; otherwise not below."""

    @property
    def met(self) -> bool:
        """Whether the value is on the right side of the bound; one that is not a number is not."""
        return self.value <= self.bound if self.at_most else self.value >= self.bound

    def __str__(self) -> str:
        sign = "≤" if self.at_most else "≥"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.what} {sign} {self.bound:g}{unit}: {'met' if self.met else 'MISSED'}"


@dataclass(frozen=True)
class Row:
    """A line of a table: its cells, and the targets that belong to it."""

    cells: tuple[str, ...]
    targets: tuple[Target, ...] = ()


@dataclass(frozen=True)
class Table:
    """A titled table; the last column shown is that of the targets, if any row has one."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    note: str = ""
    """How the figures were come by"""
    names: int = 1
    """Columns at the left that hold words; the others hold figures"""

    @property
    def targets(self) -> tuple[Target, ...]:
        """Of all rows."""
        return tuple(target for row in self.rows for target in row.targets)

    def rich(self) -> RichTable:
        """For a terminal."""
        shown = RichTable(title=self.title, caption=self.note, title_justify="left", caption_justify="left")
        for number, column in enumerate(self._headings()):
            is_figure = self.names <= number < len(self.columns)
            shown.add_column(column, justify="right" if is_figure else "left")
        for row in self.rows:
            styled = Text("\n").join(Text(str(t), "green" if t.met else "bold red") for t in row.targets)
            shown.add_row(*map(Text, row.cells), *([styled] if self.targets else []))
        return shown

    def markdown(self) -> str:
        """For a document."""
        headings = self._headings()
        figures = len(self.columns) - self.names
        rule = ["---"] * self.names + ["---:"] * figures + ["---"] * (len(headings) - len(self.columns))
        lines: list[tuple[str, ...]] = [headings, tuple(rule)]
        for row in self.rows:
            told = (" · ".join(map(str, row.targets)),) if self.targets else ()
            lines.append(tuple(cell.replace("|", "\\|") for cell in (*row.cells, *told)))
        body = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        note = f"\n\n{self.note}" if self.note else ""
        return f"### {self.title}\n\n{body}{note}\n"

    def _headings(self) -> tuple[str, ...]:
        return (*self.columns, "target") if self.targets else self.columns


def percent(value: float, digits: int = 2) -> str:
    """A share as a percentage."""
    return f"{100.0 * value:.{digits}f} %"
