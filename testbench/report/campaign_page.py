"""The report of a campaign as one page: verdict, reductions by three sources, what would balance it, runs, provenance.

:func:`campaign_report` puts together what `compare`, `doctor`, `report` and `trim` find. Its ``document`` is what
``testbench report CAMPAIGN -o report.html --json`` prints, and the page shows no number that is not in it.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from operator import call
from pathlib import Path
from typing import TYPE_CHECKING, Any

from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.report.page import Page, document_of
from balance.results import first_of, grouped_texts, plain
from balance.task_pool import HERE, TaskPool, cores

from ..cross_examination import ADVICE, Examination
from ..cross_examination.statement import decisions
from ..errors import AnalysisError, StoreError
from ..kinematics.encoder_motion import mechanism_of
from ..loads import command_tracking
from ..published_tables import MANIPULATOR, ORIGINAL_LOGS, Published
from ..recording import MEANING, Finding
from ..runs.aligned_run import AlignedRun, recorded_clocks
from ..runs.si_run import SIRun, calibrations_in_force
from ..store import Campaign, open_campaign
from ..store.atomic_files import recorded_digest
from ..store.ledger import ledger_heads
from ..trimming import trim_runs
from ..trimming.result import trim_document
from ..vibration.comparison import Comparison, compare_campaign
from ..vibration.metrics import DEFAULT_BAND, Measure
from ..vibration.reduction import verdict as reduction_verdict
from ..vibration.run_pairs import pairs
from .page_contents import conditions_of, motions_of, reductions_svg, run_label, spans_of, strongest_condition
from .run_report import Reporting, RunReport
from .sections import torque_changes

if TYPE_CHECKING:
    from markupsafe import Markup

    from ..signal.filters import Band
    from ..store import Run

NOTHING_TO_ACCEPT = "stated with the numbers"
"""Decision about a finding that is part of a result: a person accepts what is found of runs, not what follows."""
TRIM_RUNS = 3
"""Runs of a mounting from which the report says what is missing: those with the largest peak acceleration."""


@dataclass(frozen=True, eq=False)
class CampaignReport:
    """All that the page of a campaign shows."""

    name: str
    runs: tuple["Run", ...]
    comparison: Comparison | str
    """The reductions, or why there are none."""
    examination: Examination
    accepted: tuple[str, ...]
    reports: dict[str, RunReport]
    """By run."""
    unread: dict[str, str]
    """By run, why it has no report."""
    trims: tuple[dict[str, Any], ...]
    """What is missing in each mounting, or the reason why the runs cannot tell."""
    mechanism: str | None = None
    """In place of the one that the rigs name."""

    @cached_property
    def document(self) -> dict[str, Any]:
        """The report in plain JSON types, units in the keys."""
        compared = self.comparison
        manipulator = any(run.rig and SIRun.of(run).rig.mechanism.startswith(MANIPULATOR) for run in self.runs)
        published = isinstance(compared, Comparison) and compared.published is not None
        findings: list[Finding] = [] if isinstance(compared, str) else list(compared.findings)
        findings += self.examination.findings
        findings += [finding for one in self.reports.values() for finding in one.findings]
        return document_of({
            "campaign": self.name,
            "software": {"name": "counterpoise", "version": version("counterpoise")},
            "origins": Counter(str(run.origin) for run in self.runs),
            "verdict": verdict(compared),
            "comparison": {"reason": compared} if isinstance(compared, str) else _comparison(compared),
            "examination": self.examination.document(self.examination.runs),
            "trim": self.trims,
            "runs": [one.as_dict() for one in self.reports.values()],
            "unread": self.unread,
            "compared": torques_compared(self.runs, self.reports),
            "findings": grouped(dict.fromkeys(findings), self._decisions(findings)),
            "calibrations": calibrations_in_force(SIRun.of(run) for run in self.runs if run.rig),
            "provenance": [
                {
                    "run": run.name,
                    "origin": str(run.origin),
                    "sha256": digest_of(run),
                    "written": run.provenance.get("written"),
                    "software": run.provenance.get("software", {}),
                    "sources": [
                        {key: source[key] for key in ("name", "size_bytes", "sha256")}
                        for source in run.provenance["sources"]
                    ],
                }
                for run in self.runs
            ],
            "ledgers": ledger_heads(run.path.parent for run in self.runs),
            "notes": [ORIGINAL_LOGS] if manipulator or published else [],
        })  # fmt: skip

    def _decisions(self, findings: Iterable[Finding]) -> dict[str, str]:
        """By code, where a person accepted its findings, or where there is nothing to accept."""
        about_runs = {*ADVICE, *(one.code for run in self.runs for one in run.findings)}
        found = {one.code: NOTHING_TO_ACCEPT for one in findings if one.code not in about_runs}
        found |= dict.fromkeys(self.accepted, "accepted in this report (--accept)")
        accepted = {id(run): run.provenance.get("accepted_findings", ()) for run in self.runs}
        for code in {code for codes in accepted.values() for code in codes}:
            having = [run for run in self.runs if any(one.code == code for one in run.findings)]
            some = [run for run in having if code in accepted[id(run)]]
            people = [run.provenance.get("acceptance") for run in some]
            if some:
                one = people[0] if people.count(people[0]) == len(people) else None
                names, by = first_of([run.name for run in some], 4), f" by {one['by']}: {one['reason']}" if one else ""
                still_open = "open in other runs; " if len(some) < len(having) else ""
                found[code] = f"{still_open}accepted as {names} was ingested{by}"
        return found | recorded_decisions(self.runs, self.examination)

    def page(self) -> Page:
        """The page, with pictures and what its script draws."""
        pictures, figure, document = self._drawn()
        runs = [one.plotted for one in self.reports.values() if one.plotted]
        data = {
            "runs": [run.as_dict() for run in runs],
            "conditions": conditions_of(self.runs, [run.name for run in runs]),
            "motions": motions_of(self.runs, self.mechanism),
            "time": "time of the logger [s]",
        }
        about = {
            "sections": SECTIONS,
            "lacking": lacking(document["runs"]),
            "labels": {run.name: run_label(run)[0] for run in self.runs},
            "figure": figure,
            "pictures": pictures,
            "calibrations": [str(one) for one in calibrations_in_force(SIRun.of(run) for run in self.runs if run.rig)],
        }
        return Page(Path(__file__).with_name("campaign.html"), document, data, about)

    def _drawn(self) -> tuple["list[Markup]", "Markup | None", dict[str, Any]]:
        """Figures of the strongest condition and of the reductions, and the document; of many runs side by side."""
        if isinstance(self.comparison, str):
            return [], None, self.document
        parts: list[Callable[[], Any]] = [
            *strongest_condition(self.comparison, self.runs),  # the longest first
            partial(reductions_svg, self.comparison),
            lambda: self.document,
        ]
        drawn: dict[int, Any] = dict(cores(len(self.runs)).results(call, parts))
        *pictures, figure, document = (drawn[place] for place in range(len(parts)))
        return [picture for picture in pictures if picture is not None], figure, document


SECTIONS = (
    ("reductions", "Reductions"),
    ("balance", "What would balance it"),
    ("motion", "The mechanism"),
    ("series", "Time series and spectra"),
    ("runs", "Forces, torques, command"),
    ("doctor", "Cross-examination"),
    ("findings", "Findings"),
    ("budget", "Uncertainty"),
    ("provenance", "Provenance"),
)


def html_report(
    campaign: Campaign | str | Path,
    output: str | Path,
    measure: Measure | None = None,
    published: Published | None = None,
    mechanism: str | None = None,
    accept: Iterable[str] = (),
) -> Path:
    """Write the report of a campaign, or of that in a folder, as one HTML page, and return where it is.

    Reductions are of ``measure`` (peak to peak, 1..200 Hz, unless given), beside those ``published`` where a table is
    given; ``mechanism`` takes the place of the one that the rig names; contradictions whose codes are in ``accept``
    are taken for accepted by a person. Raises StoreError where there is no campaign.
    """
    opened = campaign if isinstance(campaign, Campaign) else open_campaign(campaign)
    name, pool = opened.path.resolve().name, cores(len(opened.runs))
    found = campaign_report(name, opened.runs, measure, published, mechanism, accept, pool=pool)
    return found.page().write(output)


def campaign_report(
    name: str,
    runs: "Sequence[Run]",
    measure: Measure | None = None,
    published: Published | None = None,
    mechanism: str | None = None,
    accept: Iterable[str] = (),
    point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    band: "Band | None" = DEFAULT_BAND,
    bandwidth_hz: float = command_tracking.BANDWIDTH_HZ,
    unopened: Mapping[str, str] | None = None,
    pool: TaskPool = HERE,
) -> CampaignReport:
    """All that the page of these runs shows; of each run vibration and forces in ``band``, moments about ``point`` [m].

    A part that cannot be found has the reason in its place; so have runs that could not be opened, ``unopened``.
    A run is a task of the ``pool``.
    """
    runs, accept = tuple(runs), tuple(accept)
    given = load_mechanism(mechanism) if mechanism else None
    measure = measure or Measure()
    reporting = Reporting(point, band, bandwidth_hz, mechanism, measure)
    examination, reports, unread = reporting.runs(runs, accept, pool, spans_of(runs))
    known = {id(one.run): one.amplitudes for one in reports.values() if one.amplitudes is not None}
    comparison: Comparison | str
    try:
        comparison = compare_campaign(runs, published, measure, mechanism, accept, examination, known, pool)
    except AnalysisError as error:
        comparison = str(error)
    unread = {**(unopened or {}), **unread}
    # What is missing in each mounting with counter-masses, from its runs of the largest peak accelerations.
    mountings: dict[tuple[Any, ...], list[Run]] = {}
    for pair in pairs(runs)[0]:
        key = (pair.key.payload_kg, pair.key.payloads, pair.key.origin, tuple(pair.counter_masses.items()))
        mountings.setdefault(key, []).extend(run for run in pair.balanced)
    trims = tuple(
        [_trim(key[0], dict(key[1]), dict(key[3]), some, given, examination) for key, some in mountings.items()]
    )
    return CampaignReport(name, runs, comparison, examination, accept, reports, unread, trims, mechanism)


def lacking(runs: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """The parts that reports of runs lack: each with why, once, and with the runs; numbers are those of the first."""
    found = []
    for part in ("vibration", "modes", "wrench", "response", "torque", "command"):
        reasons = {run["run"]: run[part]["reason"] for run in runs if "reason" in run[part]}
        for why, names in grouped_texts(reasons).items():
            found.append(
                (
                    "force" if part == "wrench" else part,
                    why,
                    "all runs" if len(names) == len(runs) > 1 else ", ".join(names),
                )
            )
    return found


def recorded_decisions(runs: "Sequence[Run]", examination: Examination) -> dict[str, str]:
    """By code, who accepted it for which runs and why; a contradiction that is open in other runs says so."""
    found: dict[str, list[str]] = {}
    for one in decisions(runs):
        found.setdefault(one.code, []).append(str(one))
    opened = {finding.code for finding in examination.open_findings}
    return {code: "; ".join(["open in other runs"] * (code in opened) + some) for code, some in found.items()}


def verdict(found: Comparison | str) -> str:
    """The answer in one sentence, or why there is none."""
    if isinstance(found, str):
        return f"No reduction: {found.splitlines()[0].rstrip(':')}."
    return reduction_verdict([row.analyzed for row in found.rows], found.examination)


def _comparison(found: Comparison) -> dict[str, Any]:
    """As `testbench compare --json`, with the budget of each row as `testbench analyze --budget --json` has it."""
    shown: dict[str, Any] = plain(found)
    for row, one in zip(shown["rows"], found.rows, strict=True):
        row["budget"] = plain(one.analyzed.uncertainty.budgets if one.analyzed.uncertainty else [])
    return shown


def grouped(findings: Iterable[Finding], decisions: Mapping[str, str]) -> list[dict[str, Any]]:
    """Findings by code, each with its meaning, number and decision; the open ones first."""
    found: dict[str, list[str]] = {}
    for finding in findings:
        found.setdefault(finding.code, []).append(finding.message)
    return [
        {
            "code": code,
            "meaning": MEANING.get(code, ""),
            "decision": decisions.get(code, "open"),
            "count": len(found[code]),
            "messages": found[code],
        }
        for code in sorted(found, key=lambda code: (code in decisions, code))
    ]


def digest_of(run: "Run") -> str | None:
    """That which was written with a run; None where it cannot be read."""
    try:
        return recorded_digest(run.path)
    except StoreError:
        return None


def torques_compared(runs: "Sequence[Run]", reports: dict[str, RunReport]) -> list[dict[str, Any]]:
    """Effect of the counter-masses on the torques of each condition; runs without a report are left out."""
    found = []
    for pair in pairs([run for run in runs if run.name in reports])[0]:
        sides = [[reports[run.name].parts["torque"] for run in some] for some in (pair.balanced, pair.unbalanced)]
        found.append({
            "condition": str(pair.key),
            "counter_masses_kg": pair.counter_masses,
            "origin": pair.key.origin,
            "runs": [run.name for run in pair.runs],
            "torques": torque_changes(sides[0], sides[1]),
        })  # fmt: skip
    return found


def _trim(
    payload: float | None,
    payloads: dict[str, float],
    masses: dict[str, float],
    runs: "list[Run]",
    given: Mechanism | None,
    examination: Examination,
) -> dict[str, Any]:
    """One mounting as `testbench trim --json` has it, or the reason why the runs cannot tell."""

    def peak(run: "Run") -> float:
        stated = run.conditions
        return float(stated.get("peak_acceleration_g") or stated.get("peak_acceleration_rad_s2") or 0.0)

    chosen = sorted(runs, key=peak, reverse=True)[:TRIM_RUNS]
    about: dict[str, Any] = {"payload_kg": payload, "payloads_kg": payloads, "counter_masses_kg": masses}
    about |= {"runs": [run.name for run in chosen]}
    if doubts := examination.doubts([run.name for run in chosen]):
        return {**about, "reason": f"contradictions about these runs are open: {', '.join(doubts)}"}
    try:
        bound = [SIRun.of(run) for run in chosen]
        model = given or mechanism_of(bound[0], None)
        return about | trim_document(trim_runs([AlignedRun(run, model, recorded_clocks(run)) for run in bound]))
    except CounterpoiseError as error:
        return {**about, "reason": str(error)}
