"""Columns of a text that spell numbers in another way: times of day, dates, marks of thousands, other notations."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...findings import Finding
from ...recording import Block, Report
from . import exact, midnight, notation, thousands, times
from .dialect import Dialect
from .encoding import Encoding
from .header import Header
from .notation import Noted
from .parse import Form
from .rewriting import Rewriting
from .sample import Sample, last_lines
from .thousands import Grouped
from .times import Times

Read = Callable[[Report], Iterator[Block]]


@dataclass(frozen=True)
class Spelled:
    """What was found in the first ``rows`` of a text, and in its last ones, ``ends``."""

    rows: Sequence[Sequence[str]]
    ends: Sequence[Sequence[str]]
    times: Times
    numbers: tuple[Grouped | Noted, ...]
    encoding: Encoding
    findings: tuple[Finding, ...]

    @property
    def fields(self) -> set[int]:
        """The columns that become numbers, or are taken up by such."""
        return {column.field for column in (*self.times.columns, *self.numbers)} | self.times.taken_up

    @property
    def texts(self) -> frozenset[int]:
        """The columns that hold times which cannot be told."""
        return self.times.texts

    def form(self, form: Form) -> Form:
        """The form of rows with these columns as numbers."""
        columns = (*self.times.columns, *self.numbers)
        if not columns:
            return form
        name = self.encoding.name if self.encoding.keeps_ascii else "utf-8"
        decimal = form.dialect.decimal
        return replace(
            form, rewriting=Rewriting(columns, form.separator, form.fields, decimal, name, self.times.taken_up)
        )

    def continued(self, read: Read, kept: Sequence[int]) -> Read:
        """``read`` with times of day that go on after midnight; ``kept`` are the fields of the channels."""
        columns = [kept.index(field) for field in self.times.of_day]
        return (lambda report: midnight.counted_on(read(report), columns, report)) if columns else read


def find(path: Path, sample: Sample, dialect: Dialect, header: Header, date_order: str | None = None) -> Spelled:
    """The columns of the file that begins with ``sample``; ``date_order`` is what a person says of its dates."""
    rows = [dialect.split(line) for line in sample.lines[header.first_data_line - 1 :]]

    ends = [dialect.split(line) for line in last_lines(path, sample.encoding)]
    found = times.find(rows, lambda: ends, header, date_order or "")
    grouped = [g for g in thousands.find(rows, header, dialect.decimal) if g.field not in found.spoken_for]
    noted = notation.find(rows, header, dialect.decimal, found.spoken_for | {g.field for g in grouped})
    rounded = exact.rounded([*rows, *ends], header, found.spoken_for)
    said = (*found.findings, *thousands.said(grouped, header), *notation.said(noted, header), *rounded)
    return Spelled(rows, ends, found, (*grouped, *noted), sample.encoding, said)
