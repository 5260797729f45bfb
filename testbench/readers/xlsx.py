"""Workbooks (.xlsx, .xlsm): each sheet is a text, made in a process of its own, that the reader of texts understands.

So names, units, times and rows are found by the same rules; line N is row N of the sheet.
"""

import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..recording import Block, Finding, Recording, Refusal, Report, TextLog
from .csv.reader import open_text
from .format_findings import names_listed
from .registry import ReadOptions
from .subprocess_reader import answer_in_subprocess


def open_workbook(path: Path, options: ReadOptions) -> Recording:
    """Understand the sheets; those without rows of numbers are left out by name."""
    folder = tempfile.mkdtemp(prefix="counterpoise-")
    texts, sheets = TextLog(), list[tuple[str, Recording]]()

    def read(report: Report) -> Iterator[Block]:
        for title, sheet in sheets:
            yield from _blocks(title, sheet, texts, _reporting(report, title, len(sheets) > 1))

    weakref.finalize(read, shutil.rmtree, folder, ignore_errors=True)  # with the last copy of the recording
    found = answer_in_subprocess(path, f"{__package__}.xlsx_worker", "as_texts", folder)
    settings = replace(options, encoding="utf-8", delimiter="\t", decimal=".")
    sheets += _sheets(path, found["worksheets"], Path(folder), settings, findings := list[Finding]())
    origins = {sheet.origin for _, sheet in sheets}
    return Recording(
        path=path,
        format="Excel workbook",
        reader="testbench.readers.xlsx",
        groups=tuple(replace(g, name=_name(title, sheet, g.name)) for title, sheet in sheets for g in sheet.groups),
        read=read,
        origin="simulated" if "simulated" in origins else "unstated",
        settings={f"{title}: {key}": text for title, sheet in sheets for key, text in sheet.settings.items()
                  if key in ("first_data_line", "date_order")},
        metadata=found["metadata"]
        | {f"{title}: {key}": text for title, sheet in sheets for key, text in sheet.metadata.items()},
        comments=tuple(comment for _, sheet in sheets for comment in sheet.comments),
        ranges=tuple(limit for _, sheet in sheets for limit in sheet.ranges),
        stated_rate_hz=sheets[0][1].stated_rate_hz if len(sheets) == 1 else None,
        findings=tuple(findings),
        texts=texts,
    )  # fmt: skip


def _sheets(
    path: Path, worksheets: list[dict[str, Any]], folder: Path, settings: ReadOptions, findings: list[Finding]
) -> list[tuple[str, Recording]]:
    """The sheets with rows of numbers, by title; what is odd in them, and the others, go to ``findings``.

    Raises Refusal where there is none.
    """
    sheets, left = list[tuple[str, Recording]](), list[Finding]()
    for number, told in enumerate(worksheets, 1):
        title, text = told["title"], folder / f"{number}.txt"
        try:
            sheets.append((title, open_text(text, settings)))
        except Refusal as refusal:
            reason = refusal.finding.message if text.stat().st_size else "it is empty"
            left.append(Finding("left_out", None, f"worksheet {title!r}", f"the worksheet is not kept: {reason}"))
            continue
        findings += _findings(told)
    if not sheets:
        each = "; ".join(f"{finding.where}: {finding.message}" for finding in left[:10])
        said = each or "no worksheet, or Strict Open XML: save it as .xlsx"
        raise Refusal(path.name, Finding("no_data", None, None, said))
    for title, sheet in sheets:
        add = _reporting(findings.append, title, len(sheets) > 1)
        for finding in sheet.findings:
            first = sheet.settings["first_data_line"]
            if finding.code == "dialect":
                findings.append(Finding("dialect", None, f"worksheet {title!r}", f"first row of data in row {first}"))
            else:
                add(finding)
    findings += left
    return sheets


def _findings(told: Mapping[str, Any]) -> Iterator[Finding]:
    """What a text does not show: what is hidden, calculated, merged, and beside the table far down."""
    hidden = ["the worksheet itself"] if told["is_hidden"] else []
    hidden += [f"{told['hidden_rows']} rows"] if told["hidden_rows"] else []
    hidden += [f"columns from {names_listed(told['hidden_columns'])} on"] if told["hidden_columns"] else []
    formulas = names_listed([f"{column} ({count})" for column, count in told["formulas"].items()])
    messages = [
        ("hidden_cells", hidden, f"the spreadsheet hides {', '.join(hidden)}; all are kept"),
        ("calculated_cells", formulas, f"cells of formulas by column: {formulas}; their values are those that were "
         "stored, nothing is computed"),
        ("left_out", told["beyond"], f"columns {names_listed(told['beyond'])} are empty in the first rows: what is "
         "below is not kept"),
        *(("dialect", True, f"the merged cells of row {row} are put before the names in row {row + 1}")
          for row in told["joined"]),
    ]  # fmt: skip
    for code, there, message in messages:
        if there:
            yield Finding(code, None, f"worksheet {told['title']!r}", message)


def _name(title: str, sheet: Recording, group: str) -> str:
    """The name of a group by its sheet in place of the text's file."""
    return title + group.removeprefix(sheet.path.stem)


def _reporting(report: Report, title: str, several: bool) -> Report:
    """``report`` of findings that know their sheet where there are ``several``."""

    def reported(finding: Finding) -> None:
        if several:
            where = f"worksheet {title!r}" + (f", {finding.where}" if finding.where else "")
            finding = replace(finding, where=where)
        report(finding)

    return reported


def _blocks(title: str, sheet: Recording, texts: TextLog, report: Report) -> Iterator[Block]:
    sheet.texts.clear()
    for block in sheet.read(report):
        yield replace(block, group=replace(block.group, name=_name(title, sheet, block.group.name)))
    for series in sheet.texts.kept:
        name = _name(title, sheet, series.group)
        texts.series[name, series.channel] = replace(series, group=name)
    texts.given_up |= {(_name(title, sheet, group), channel) for group, channel in sheet.texts.given_up}
