"""A figure of a study, and the table of all figures: ``docs/validation/results.json`` and the page beside it."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

from scipy.stats import binomtest

LEVEL = 0.95
"""Confidence level of the intervals that are counted."""
SIGNIFICANCE = 1e-3
"""Of the binomial test that rejects a count."""


@dataclass(frozen=True)
class Row:
    """A figure and the range that it must lie in, both ends included; None where nothing is required on that side."""

    quantity: str
    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value lies in the required range."""
        return (self.low is None or self.value >= self.low) and (self.high is None or self.value <= self.high)

    @property
    def required(self) -> str:
        """The required range in words; empty where nothing is required."""
        if self.low is None and self.high is None:
            return ""
        if self.low is None:
            return f"at most {self.high:g}"
        if self.high is None:
            return f"at least {self.low:g}"
        return f"{self.low:g}" if self.low == self.high else f"{self.low:g} to {self.high:g}"

    @property
    def verdict(self) -> str:
        """``holds`` or ``fails``; ``shown`` where nothing is required."""
        return ("holds" if self.passed else "fails") if self.required else "shown"

    @property
    def line(self) -> str:
        """The figure in one line."""
        required = f" (required: {self.required})" if self.required else ""
        return f"{self.quantity}: {self.value:.6g} {self.unit}{required}: {self.verdict}. {self.note}".rstrip(". ")


@dataclass
class Tally:
    """How many of ``count`` intervals contain the truth."""

    hits: int = 0
    count: int = 0

    def add(self, hit: bool) -> None:
        """Count one interval."""
        self.count += 1
        self.hits += bool(hit)


@dataclass(frozen=True)
class Origin:
    """What gave the figures of a study."""

    study: str
    command: str
    commit: str
    date: str
    brief: bool


def covered(quantity: str, hits: int, count: int, note: str = "", conservative: bool = False) -> Row:
    """How many of ``count`` 95 % intervals contain the truth, with what a binomial test at 0.1 % accepts.

    The test is two-sided; one-sided where the interval is a bound that may be ``conservative``.
    """
    low, high = acceptance(count, conservative) if count else (None, None)
    return Row(quantity, int(hits), f"of {count}", low, high, note)


@cache
def acceptance(count: int, conservative: bool = False) -> tuple[int, int]:
    """Smallest and largest number of ``count`` intervals that may contain the truth."""
    side: Literal["less", "two-sided"] = "less" if conservative else "two-sided"
    accepted = [hits for hits in range(count + 1) if binomtest(hits, count, LEVEL, side).pvalue > SIGNIFICANCE]
    return accepted[0], accepted[-1]


def all_of(quantity: str, passed: int, count: int, note: str = "") -> Row:
    """How many of ``count`` trials went as they must: all."""
    return Row(quantity, passed, f"of {count}", count, count, note)


def write_table(folder: Path, origin: Origin, rows: Sequence[Row]) -> None:
    """Put a study's figures in the place of its earlier ones, in ``results.json`` and ``results.md`` of ``folder``."""
    path = folder / "results.json"
    figures = json.loads(path.read_text(encoding="utf-8"))["figures"] if path.exists() else []
    new = [{**asdict(origin), **asdict(row), "required": row.required, "verdict": row.verdict} for row in rows]
    figures = [figure for figure in figures if figure["study"] != origin.study] + new
    figures.sort(key=lambda figure: figure["study"])  # stable: within a study in the order they came
    folder.mkdir(parents=True, exist_ok=True)
    lines = ",\n".join(json.dumps(figure, ensure_ascii=False) for figure in figures)
    path.write_text(f'{{"figures": [\n{lines}\n]}}\n', encoding="utf-8")
    (folder / "results.md").write_text("\n".join(_page(figures)), encoding="utf-8")


def _page(figures: Iterable[dict[str, Any]]) -> list[str]:
    lines = [
        "# Results of the studies",
        "",
        "Written by `python -m studies` (`make study`); the same figures are in `results.json`. Of 95 % intervals",
        "as many must contain the truth as a binomial test at 0.1 % accepts; trials must all go as they should. A",
        "command is that of the commit beside it; those of today are on the page [validation](index.md).",
    ]
    for origin, rows in groupby(figures, lambda figure: Origin(*(figure[field.name] for field in fields(Origin)))):
        at = f"`{origin.command}` at {origin.commit}, {origin.date}{', brief' if origin.brief else ''}"
        lines += ["", f"## {origin.study}", "", at, ""]
        lines += ["| quantity | value | required | verdict | note |", "|---|---|---|---|---|", *map(_cells, rows)]
    return [*lines, ""]


def _cells(figure: dict[str, Any]) -> str:
    value = f"{figure['value']:.6g} {figure['unit']}".strip()
    return "| " + " | ".join([figure["quantity"], value, figure["required"], figure["verdict"], figure["note"]]) + " |"
