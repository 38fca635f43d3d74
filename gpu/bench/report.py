"""The results of a benchmark: as Markdown for people, as plain values for machines."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from halfstep.bench.timing import Line

# A cell of a table: a number whose unit stands in the heading, a name, or None for no value.
Value = float | int | str | None


@dataclass(frozen=True)
class Part:
    """One part of the benchmark.

    Attributes:
        name: its name for the option `--only`.
        title: the measurement and its scene.
        rows: values by heading, the same headings in each row; headings give units.
        summary: the main results in words, by what was measured.
        fits: lines fitted to columns, by description.
        notes: other facts, and what was left out and why.
    """

    name: str
    title: str
    rows: list[dict[str, Value]]
    summary: dict[str, str] = field(default_factory=dict)
    fits: dict[str, Line] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """The part for JSON."""
        fits = {
            name: {"slope": fit.slope, "intercept": fit.intercept, "r_squared": fit.r_squared}
            for name, fit in self.fits.items()
        }
        return {
            "title": self.title,
            "rows": self.rows,
            "summary": self.summary,
            "fits": fits,
            "notes": self.notes,
        }

    def as_text(self) -> str:
        """The part as Markdown: a table under its title."""
        lines = [f"**{self.title}**", ""]
        if self.rows:
            heads = list(self.rows[0])
            rules = ["--:" if _is_number(self.rows, head) else "---" for head in heads]
            lines += [_line(heads), f"|{'|'.join(rules)}|"]
            lines += [_line([_shown(row[head]) for head in heads]) for row in self.rows] + [""]
        for name, fit in self.fits.items():
            lines += [
                f"{name}: {fit.slope:.4g} × + {fit.intercept:.4g}, R² = {fit.r_squared:.4f}",
                "",
            ]
        lines += [part for note in self.notes for part in (note, "")]
        return "\n".join(lines)


@dataclass(frozen=True)
class Report:
    """All parts, and the facts of the machine that measured them."""

    machine: dict[str, str | int]
    rounds: int
    parts: tuple[Part, ...]

    def as_dict(self) -> dict[str, Any]:
        """The report for JSON."""
        return {
            "machine": self.machine,
            "rounds": self.rounds,
            "parts": {part.name: part.as_dict() for part in self.parts},
        }

    def as_text(self) -> str:
        """The report as Markdown."""
        facts = ", ".join(f"{name} {value}" for name, value in self.machine.items())
        lines = [
            f"{facts}; medians of {self.rounds} rounds",
            "",
            "| what | measured |",
            "|---|---|",
        ]
        for part in self.parts:
            lines += [_line([what, found]) for what, found in part.summary.items()]
        return "\n".join([*lines, "", *(part.as_text() for part in self.parts)])


def _is_number(rows: list[dict[str, Value]], head: str) -> bool:
    return all(row[head] is None or isinstance(row[head], int | float) for row in rows)


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _shown(value: Value) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
    return f"{value:,}" if isinstance(value, int) else value
