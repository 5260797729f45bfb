"""The viewer: a campaign in the browser, its runs read as they are looked at, its findings accepted by a person.

The page is the report's, its script too; the runs hold no samples, which are asked for by range. One run is drawn over
another on the clock of the first, later by what :class:`.overlay.RunTraces` finds, with their difference.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.report.loopback import Loopback
from balance.report.page import Page, document_of
from balance.report.plotted import LEAST_SPANS, spectrum
from balance.results import instant_text

from ..cross_examination import Examination, examine
from ..cross_examination.statement import accept
from ..errors import AnalysisError, StoreError
from ..recording import Severity
from ..signal.welch import SEGMENT, welch
from .campaign_page import campaign_report, digest_of, grouped, recorded_decisions
from .overlay import RunTraces
from .page_contents import conditions_of, run_label
from .traces import LOOKED_AT, Difference, Lag

if TYPE_CHECKING:
    from ..store import Run

MOST_SPANS = 20_000
"""Of a line, whatever is asked for."""
SECTIONS = (("series", "Time series and spectra"), ("findings", "Findings"), ("whole", "The report"))


@dataclass(eq=False)
class Viewer:
    """What the page of a campaign is made of and asks for."""

    name: str
    runs: "Sequence[Run]"
    unopened: Mapping[str, str] = field(default_factory=dict)
    """Runs that cannot be opened, and why."""

    def __post_init__(self) -> None:
        self._one_at_a_time, self._comparing = Lock(), Lock()
        self._traces = RunTraces(self.runs)
        self._digests = {run.name: digest_of(run) for run in self.runs}

    def server(self, port: int = 0) -> Loopback:
        """A server of all this, for this machine alone."""
        pages = {
            "": lambda _: self.page().html(), "samples": self.samples, "difference": self.differences,
            "spectrum": self.spectrum, "findings": self.findings, "report": self.report,
        }  # fmt: skip
        return Loopback(pages, {"accept": self.accept}, port)

    def page(self) -> Page:
        """The page, without samples."""
        runs = [self._listed(run) for run in self.runs]
        shown = [one for one in runs if one["channels"]]
        document = document_of({
            "campaign": self.name, "origins": Counter(str(run.origin) for run in self.runs),
            "runs": list(self._traces.by_name), "unread": {**self.unopened, **self._traces.unbound},
        })  # fmt: skip
        names = [one["name"] for one in shown]
        data = {
            "runs": shown,
            "conditions": conditions_of(self.runs, names),
            "time": "time of the first run's logger [s]",
        }
        here = Path(__file__)
        return Page(here.with_name("view.html"), document, data, {"sections": SECTIONS}, here.with_name("view.js"))

    def _listed(self, run: "Run") -> dict[str, Any]:
        """A run in the lists of the page."""
        label, balanced = run_label(run)
        channels = [
            {"kind": one.kind, "name": name, "unit": one.unit, "id": place, "values": "", "start": 0.0, "step": 1.0}
            for place, (name, one) in enumerate(self._traces.of(run.name).items())
        ]
        about = {
            "name": run.name,
            "label": label,
            "balanced": balanced,
            "id": list(self._traces.by_name).index(run.name),
        }
        return about | {"channels": channels, "spectra": channels}

    def _compared(self, first: str, second: str, channel: str) -> tuple[Lag, Difference | None]:
        """Likewise of ``RunTraces``: what several lines of the page need is found once."""
        with self._comparing:
            return self._traces.compared(first, second, channel)

    def _range(self, words: Mapping[str, str]) -> tuple[str, str, str, float, float]:
        """Run, first run, channel, begin and end [s] that are asked for by number. Raises LookupError, ValueError."""
        run, first = (list(self._traces.by_name)[int(words[key])] for key in ("run", "first"))
        self._refuse_changed(self._traces.by_name[one] for one in (run, first))
        channel = list(self._traces.of(run))[int(words["channel"])]
        return run, first, channel, float(words["from"]), float(words["to"])

    def _refuse_changed(self, runs: "Iterable[Run]") -> None:
        """Raise StoreError for a run that is not that which was opened: what is known of it is of another."""
        for run in runs:
            if digest_of(run) != self._digests[run.name]:
                raise StoreError(f"{run.name}: was changed since it was opened; end testbench view and start it again")

    def samples(self, words: Mapping[str, str]) -> dict[str, Any]:
        """A channel of a run on the clock of the first, from one instant to another, for the page."""
        run, first, channel, begin, end = self._range(words)
        late, _ = self._compared(first, run, channel) if run != first else (Lag(0.0, 0.0, ""), None)
        found = self._traces.of(run)[channel].between(begin + late.seconds, end + late.seconds, _spans(words))
        shift = f"{abs(late.seconds):.6f} s {'earlier' if late.seconds > 0.0 else 'later'} than its logger says"
        about = f"{run} is drawn {shift}, aligned to {first} by {late.by}."
        return replace(found, start=found.start - late.seconds).as_dict() | {"about": about if late.by else ""}

    def differences(self, words: Mapping[str, str]) -> dict[str, Any]:
        """A channel of a run less that of the first, for the page."""
        run, first, channel, begin, end = self._range(words)
        _, found = self._compared(first, run, channel)
        if found is None:
            raise AnalysisError(f"{first}: has no channel {channel!r}, so that there is no difference")
        drawn = [one.between(begin, end, _spans(words)).as_dict() for one in (found.trace, found.half_width) if one]
        return drawn[0] | {
            "half_width": drawn[-1] if found.half_width else None,
            "note": f"{run} less {first}: {found.text}",
        }

    def spectrum(self, words: Mapping[str, str]) -> dict[str, Any]:
        """The power spectral density of what is between two instants, of at most LOOKED_AT samples."""
        run, _, channel, begin, end = self._range(words)
        trace = self._traces.of(run)[channel]
        time, values = trace.within(begin, end)
        inside = (time >= begin) & (time <= end)
        time, values = time[inside][:LOOKED_AT], values[inside][:LOOKED_AT]
        if len(time) < 8 or not np.isfinite(values).all():
            raise AnalysisError(f"{run}: {channel}: expected at least 8 samples without a gap for a spectrum")
        rate = (len(time) - 1) / float(time[-1] - time[0])
        if float(np.abs(np.diff(time) * rate - 1.0).max()) > 0.5:
            raise AnalysisError(
                f"{run}: {channel}: samples are missing between {instant_text(time[0])} and {instant_text(time[-1])} s"
            )
        found = welch([values], rate, min(SEGMENT, len(values) // 2 * 2))
        drawn = spectrum(trace.kind, channel, trace.unit, found.frequency, found.power())
        return drawn | {
            "about": f"{run}: {len(time)} samples from {instant_text(time[0])} to {instant_text(time[-1])} s."
        }

    @cached_property
    def examination(self) -> Examination:
        """What the sensors of all runs state of each other, before anybody's decision."""
        return examine(self.runs)

    def findings(self, _: Mapping[str, str]) -> dict[str, Any]:
        """Findings by code, those of ingest from warnings on, each with the decision about it."""
        with self._one_at_a_time:
            examination = self.examination
        of_ingest = (one for run in self.runs for one in run.findings if one.severity >= Severity.WARNING)
        decided = recorded_decisions(self.runs, examination.decided(self.runs))
        found = grouped(dict.fromkeys([*examination.findings, *of_ingest]), decided)
        return {"verdict": examination.verdict(examination.runs), "findings": found}

    def accept(self, words: Mapping[str, str]) -> dict[str, Any]:
        """Record that a person accepts a ``code`` in all runs that have it now, and what is known then."""
        code, by, reason = words["code"], words["by"], words["reason"]
        about = {s.run for s in self.examination.contradictions if s.code == code}
        about |= {run.name for run in self.runs if any(one.code == code for one in run.findings)}
        runs = [run for run in self.runs if run.name in about]
        self._refuse_changed(runs)
        for folder in dict.fromkeys(run.path.parent for run in runs or self.runs):
            accept(folder, code, [run for run in runs if run.path.parent == folder], by, reason)
        return self.findings({})

    def report(self, _: Mapping[str, str]) -> str:
        """The page of `testbench report`, made anew."""
        with self._one_at_a_time:
            return campaign_report(self.name, self.runs, unopened=self.unopened).page().html()


def _spans(words: Mapping[str, str]) -> int:
    return min(max(int(words["spans"]), LEAST_SPANS), MOST_SPANS)
