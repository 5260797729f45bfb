"""What the commands that read logs share: their options, findings for people, exit codes."""

import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS

if TYPE_CHECKING:
    from ..findings import Finding
    from ..readers import ReadOptions

_DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "blanks": " "}
_DECIMALS = {"point": ".", "comma": ","}
_ORDERS = ("dmy", "mdy", "ymd")


def text_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """What a person may say about a text instead of having it detected."""
    for option in reversed((
        click.option("--encoding", metavar="NAME", help="Encoding of texts, such as cp1254; else detected."),
        click.option("--delimiter", type=click.Choice([*_DELIMITERS]), help="Delimiter of texts; else detected."),
        click.option("--decimal", type=click.Choice([*_DECIMALS]), help="Decimal mark of texts; else detected."),
        click.option("--header/--no-header", default=None, help="Whether texts begin with names; else detected."),
        click.option("--date-order", type=click.Choice([*_ORDERS]),
                     help="Order in dates such as 03/04/2024 or 24/03/04; else as a number above 12 shows."),
    )):  # fmt: skip
        command = option(command)
    return command


def read_options(
    encoding: str | None,
    delimiter: str | None,
    decimal: str | None,
    header: bool | None,
    date_order: str | None = None,
) -> "ReadOptions":
    """The options as the readers take them."""
    from ..readers import ReadOptions

    return ReadOptions(
        encoding,
        None if delimiter is None else _DELIMITERS[delimiter],
        None if decimal is None else _DECIMALS[decimal],
        header,
        date_order,
    )


def refuse_patterns(files: Iterable[Path]) -> None:
    """Refuse patterns such as ``*.csv`` that the shell handed on because no file matches them."""
    from ..errors import RecordingError
    from ..readers.registry import missing

    for file in files:
        if any(sign in str(file) for sign in "*?") and not file.exists():
            raise RecordingError(missing(file))


def exit_code(findings: Iterable["Finding"], accepted: Iterable[str] = ()) -> int:
    """0 without findings that matter, 3 with some, 1 with one for which a recording is refused."""
    from ..findings import Severity, refused, worst

    findings = list(findings)
    if refused(findings, accepted):
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if worst(findings) > Severity.NOTE else 0


SHOWN_ALIKE = 5
"""Findings of one code and file that are printed for people."""


def print_findings(title: str, findings: Iterable["Finding"]) -> None:
    """Findings as lines for people, the gravest first; of many alike the first ones, and how many more there are."""
    ordered = sorted(findings, key=lambda finding: -finding.severity)
    if ordered:
        click.echo(plain(title))
    counts = Counter(finding.code for finding in ordered)
    shown: Counter[str] = Counter()
    for finding in ordered:
        shown[finding.code] += 1
        more = counts[finding.code] - SHOWN_ALIKE
        if more > 1 and shown[finding.code] > SHOWN_ALIKE:
            if shown[finding.code] == SHOWN_ALIKE + 1:
                severity = finding.severity.name.lower()
                click.echo(f"  {severity:7} {finding.code}: and {more} more like these; --json lists all")
            continue
        group = finding.group and f"group {finding.group}"
        place = ", ".join(filter(None, (finding.channel, group, finding.where)))
        text = f"{place}: {finding.message}" if place else finding.message
        click.echo(f"  {finding.severity.name.lower():7} {finding.code}: {plain(text)}")


def plain(text: str) -> str:
    """Text from a file without what would steer a terminal."""
    return "".join(c if unicodedata.category(c)[0] != "C" else f"\\x{ord(c):02x}" for c in text)
