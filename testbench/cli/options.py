"""What commands share: options of amplitudes and of text logs, RUN arguments, findings, calibrations, progress bar."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from balance.cli.framework import EXIT_REFUSED, EXIT_WITH_FINDINGS, Read, Word, argument, option
from balance.cli.printing import emit_findings, emit_table, plain_text, say
from balance.results import first_of

if TYPE_CHECKING:
    from balance.estimation.uncertainty_budget import Budget

    from ..recording import Finding
    from ..runs.calibration_history import CalibrationInForce
    from ..runs.si_run import SIRun
    from ..signal.filters import Band
    from ..store import Run

LONGEST = 2000
"""Characters of a name or reason in the ledger."""
T = TypeVar("T")
_DELIMITERS = ("comma", "semicolon", "tab", "bar", "blanks")
_DECIMALS = {"point": ".", "comma": ","}


def _band(text: str) -> "Band | None":
    """``LO..HI`` in Hz as a band, ``none`` as None."""
    from ..signal.filters import band_of

    return band_of(text)


def _positive(_context: click.Context, parameter: click.Parameter, hertz: float | None) -> float | None:
    if hertz is not None and not hertz > 0.0:
        raise click.UsageError(f"{parameter.opts[0]} {hertz:g}: expected a positive frequency")
    return hertz


def frequency(text: str, **attributes: Any) -> Any:  # noqa: ANN401
    """An option of a frequency above zero [Hz]."""
    return option(text, metavar="HZ", callback=_positive, **attributes)


BAND_TEXT = Read("lo..hi", _band)
RIG = option("A rig in place of the one stored with the runs.")


def contradictions(text: str, *others: str) -> Any:  # noqa: ANN401
    """``--accept``: codes of contradictions, completed by the shell, or ``others``; no other is let pass."""

    def completed(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
        from ..cross_examination import ADVICE

        return [code for code in sorted(ADVICE) if code.startswith(incomplete)]

    def known(_context: click.Context, _parameter: click.Parameter, codes: tuple[str, ...]) -> tuple[str, ...]:
        from ..cross_examination import ADVICE

        if wrong := [code for code in codes if code not in ADVICE and code not in others]:
            raise click.UsageError(f"--accept {wrong[0]}: no such contradiction: expected {', '.join(sorted(ADVICE))}")
        return codes

    return option(text, metavar="CODE", shell_complete=completed, callback=known)


ACCEPT = contradictions(
    "Code of a contradiction that a person accepts: its numbers are given, marked. Give it again for more."
)
BY = option("Who accepts it, for the ledger; with --reason.", metavar="NAME")
REASON = option("Why it is accepted.", metavar="TEXT")


def acceptance(accept: Sequence[str], by: str | None, reason: str | None) -> dict[str, str] | None:
    """Who accepts findings, and why, where that is stated."""
    if by is None and reason is None:
        return None
    person = {"by": one_line("--by", by), "reason": one_line("--reason", reason)}
    if not (accept and all(person.values())):
        raise click.UsageError("--accept CODE, --by NAME and --reason TEXT go together: a person accepts, and says why")
    return person


def one_line(option: str, text: str | None) -> str:
    """What a person states for the ledger, in one line, empty where nothing is stated.

    Refuses as a wrong command line what no terminal shows, such as control characters, and what nobody reads.
    """
    line = " ".join((text or "").split())
    if not line.isprintable() or len(line) > LONGEST:
        raise click.UsageError(f"{option}: expected printable text of up to {LONGEST} characters")
    return line


MECHANISM_AND_RUNS = argument("[MECH] RUN...", required=True)
"""Where MECH may be left out: it is stored with the runs."""


def split_words(words: Sequence[str]) -> tuple[str | None, tuple[Path, ...]]:
    """MECH, None where the first word is a run or a campaign, and the runs. No run is a wrong command line."""
    given = Path(words[0]).suffix != ".h5" and not Path(words[0]).is_dir()
    if given and len(words) < 2:
        raise click.UsageError(f"{words[0]}: no stored run (.h5) and no campaign: expected [MECH] RUN...")
    return (words[0] if given else None), tuple(Path(word) for word in words[given:])


BUDGET = option("Also what contributes how much to each interval (uncertainty budget, JCGM 100).")


def print_budgets(of: str, budgets: "Iterable[Budget]") -> None:
    """Print the budgets of what is stated of one thing, the largest contribution first; a line where there is none."""
    from balance.estimation.uncertainty_budget import budget_rows

    every = list(budgets)
    for one in every:
        emit_table(f"{of}: {one.quantity}", *budget_rows(one), one.text)
    if not every:
        say(f"{of}: no budget, for there is no interval, or the amplitudes are within the noise.")


def print_findings(findings: Iterable["Finding"]) -> None:
    """Print findings of an analysis, by code."""
    emit_findings((finding.code, finding.message) for finding in findings)


def calibrations(runs: "Iterable[Run | SIRun]") -> "list[CalibrationInForce]":
    """The calibrations in force in runs; none where the logs are in physical units already, or there is no rig."""
    from ..runs.si_run import SIRun, calibrations_in_force

    bound = (run if isinstance(run, SIRun) else run.rig and SIRun.of(run) for run in runs)
    return calibrations_in_force(run for run in bound if run)


def ledgers(runs: "Iterable[Run | SIRun]") -> list[dict[str, Any]]:
    """The campaigns of runs, and what their ledgers had come to."""
    from ..store.ledger import ledger_heads

    return ledger_heads(run.path.parent for run in runs)


def provenance(runs: "Sequence[Run | SIRun]") -> dict[str, Any]:
    """What documents say of the runs that they are from: calibrations in force, and the campaigns' ledgers."""
    return {"calibrations": calibrations(runs), "ledgers": ledgers(runs)}


def print_provenance(runs: "Sequence[Run | SIRun]") -> None:
    """Print a line for each calibration, then one for each campaign that has a ledger."""
    print_calibrations(calibrations(runs))
    for one in ledgers(runs):
        if one["head"]:
            say(f"Ledger of {plain_text(one['campaign'])}: {one['entries']} entries, head {one['head']}.")


def print_calibrations(found: "Sequence[CalibrationInForce]") -> None:
    """Print a line for each calibration, with the runs in which it is in force."""
    for one in found:
        say(f"Calibrated {one}, in {first_of(one.runs, 4)}.")


def _one_description(_context: click.Context, _parameter: click.Parameter, given: tuple[str, ...]) -> str | None:
    """The description of all logs of a command: of two, one would be left out in silence."""
    if len(given) > 1:
        raise click.UsageError("--as: is of all logs; for several loggers name each in the rig: loggers.NAME.read_as")
    return given[0] if given else None


_TEXT_OPTIONS = {
    "encoding": option("Encoding of texts, such as cp1254; else detected.", metavar="NAME"),
    "delimiter": option("Delimiter of texts; else detected.", Word(_DELIMITERS)),
    "decimal": option("Decimal mark of texts; else detected.", Word([*_DECIMALS])),
    "header": option("Whether texts begin with names; else detected.", None, "--header/--no-header", default=None),
    "date_order": option(
        "Order in dates such as 03/04/2024 or 24/03/04; else as a number above 12 shows.", Word(["dmy", "mdy", "ymd"])
    ),
    "described": option(
        "An import description, or a shipped one by name; `testbench describe FILE` writes one.", None, "--as",
        metavar="DESCRIPTION", multiple=True, callback=_one_description,
    ),
}  # fmt: skip


def text_options(command: Callable[..., T]) -> Callable[..., T]:
    """Add the options of text logs that replace detection; the command takes them together, as ``reading``."""

    @wraps(command)
    def with_reading(
        *,
        encoding: str | None,
        delimiter: str | None,
        decimal: str | None,
        header: bool | None,
        date_order: str | None,
        described: str | None,
        **given: Any,  # noqa: ANN401
    ) -> T:
        from ..readers import ReadOptions
        from ..readers.csv.dialect import DELIMITERS

        description = None
        if described is not None:
            from ..readers.import_description import ImportDescription

            description = ImportDescription.load(described)
        between, mark = DELIMITERS.get(delimiter or ""), _DECIMALS.get(decimal or "")
        return command(reading=ReadOptions(encoding, between, mark, header, date_order, description), **given)

    for name, declared in reversed(_TEXT_OPTIONS.items()):
        with_reading = declared(name, str)(with_reading)
    return with_reading


def exit_code(findings: Iterable["Finding"], accepted: Iterable[str] = ()) -> int:
    """0 with notes at most, 3 with findings, 1 with one for which a recording is refused."""
    from ..recording import Severity, refusing_findings, worst_severity

    findings = list(findings)
    if refusing_findings(findings, accepted):
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if worst_severity(findings) > Severity.NOTE else 0


def print_reading_findings(title: str, findings: Iterable[tuple[str, "Finding"]]) -> None:
    """Print findings below a title, the gravest first, with their place; once what several logs, by name, share."""

    def text(log: str, finding: "Finding") -> str:
        group = finding.group and f"group {finding.group}"
        place = ", ".join(filter(None, (finding.channel, group, finding.where)))
        message = finding.message.removeprefix(f"{log}: ").removeprefix(f"{log}, ")  # the log's name stands before it
        return f"{place}: {message}" if place else message

    logs: dict[tuple[str, str], list[str]] = {}
    for log, one in sorted(findings, key=lambda found: -found[1].severity):
        logs.setdefault((f"{one.severity.name.lower():7} {one.code}", text(log, one)), []).append(log)
    if logs:
        say(plain_text(title))
        emit_findings((kind, ": ".join(filter(None, (first_of(of, 3), said)))) for (kind, said), of in logs.items())


@dataclass(frozen=True)
class NotOpened:
    """A run that cannot be opened, and why; an entry among the runs in JSON."""

    run: str
    message: str
    status: str = "refused"

    def __str__(self) -> str:
        return self.message


def openable_runs(paths: Sequence[Path]) -> "tuple[list[Run], list[NotOpened]]":
    """The runs that can be opened and those that cannot, for commands that process each run by itself."""
    from ..errors import StoreError
    from ..store import open_campaign, open_run
    from ..store.campaign import newest_versions

    runs, refused = [], []
    for path in paths:
        opened, files = [], [path]
        try:
            files = open_campaign(path).run_paths if path.is_dir() else files
        except StoreError as error:
            refused.append(NotOpened(path.name, str(error)))
            continue
        for file in files:
            try:
                opened.append(open_run(file))
            except StoreError as error:
                refused.append(NotOpened(file.stem, str(error)))
        runs += newest_versions(opened) if path.is_dir() else opened
    return runs, refused


def runs_shown(paths: Sequence[Path]) -> "tuple[str, list[Run], list[NotOpened]]":
    """How what is given is called, its runs, and those that cannot be opened. Raises StoreError where none can."""
    from ..errors import StoreError

    opened, refused = openable_runs(paths)
    if not opened:
        raise StoreError("; ".join(map(str, refused)) or f"{paths[0]}: no run")
    name = paths[0].resolve().name if paths[0].is_dir() else ", ".join(run.name for run in opened)
    return name, opened, refused


def each_run(runs: "Iterable[Run]", work: "Callable[[Run], T]") -> "tuple[list[T], list[NotOpened]]":
    """What ``work`` makes of each run, and the runs that it refused with the reason."""
    from balance.errors import CounterpoiseError

    done, refused = [], []
    for run in runs:
        try:
            done.append(work(run))
        except CounterpoiseError as error:
            refused.append(NotOpened(run.name, str(error)))
    return done, refused
