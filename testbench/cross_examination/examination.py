"""All witnesses of a campaign heard: what contradicts the run table, the rig or the other runs, and what nobody saw."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from html import escape
from typing import Any

from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism
from balance.results import Shown, document, first_of
from balance.task_pool import HERE, TaskPool

from ..errors import AnalysisError
from ..kinematics.encoder_motion import mechanism_of
from ..recording import Finding
from ..rig.rig import NONE
from ..runs.si_run import SIRun
from ..store import Run
from .conditions import UNDETERMINED, TorqueBalance, accelerations, in_grams, motions, mounted, payloads, unlike_repeats
from .copies import OneRecording, copies
from .observation import Observation, observe
from .paths import encoder_paths, record_ends
from .repeated_sizes import repeated_sizes
from .repeated_vibration import repeated_vibration
from .sensors import examined_sensors, levels, mechanisms
from .statement import WITHHOLDING, Statement, decisions

CONDITIONS = frozenset({"payload_contradiction", "counter_mass_contradiction"})
"""Contradictions after which a run is no witness of its sensors' gains: the model was that of other masses."""
OTHER_RUNS = CONDITIONS | {
    "acceleration_contradiction", "motion_contradiction", "encoder_contradiction", "short_record",
}  # fmt: skip
"""Contradictions of a run that holds the log of another."""
OF_CHANNELS = frozenset({
    "axis_contradiction", "gain_contradiction", "sign_contradiction", "force_sign", "flat_channel",
})  # fmt: skip
"""Contradictions of a channel that does not fit the run, as one of another run's log may not."""
WITNESSED = ("payload", "counter-masses", "acceleration", "axis", "gain", "sign", "rest", "copy")
"""Subjects of which a run should have a witness."""

MOST_SHOWN = 20
"""Contradictions that the prompt shows."""
DOUBTED = "contradicted"
"""Key of the reason that comes before those of single witnesses."""


@dataclass(frozen=True)
class Examination(Shown, rows="statements"):
    """What a campaign's witnesses state.

    >>> import testbench
    >>> sorted(testbench.doctor("campaign").table().columns)[:3]
    ['advice', 'channel', 'code']
    """

    runs: tuple[str, ...]
    statements: tuple[Statement, ...]
    reasons: dict[str, dict[str, str]]
    """By run and witness, why it is silent."""
    torque: TorqueBalance | None = None
    """Payloads and scales of the torques that explain all runs together."""
    accepted: frozenset[str] = field(default=frozenset())
    """Codes that a person accepts."""
    unexamined: dict[str, str] = field(default_factory=dict)
    """By run, why nothing can be heard of it."""
    sensors: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)
    """By run, accelerometers of several axes and their channels."""

    def __repr__(self) -> str:
        """The verdict and what contradicts; all else is in the table."""
        found = [finding.message for finding in self.findings]
        more = [f"and {len(found) - MOST_SHOWN} more: .findings"] if len(found) > MOST_SHOWN else []
        also = f"{len(self.statements)} statements: .table()"
        return "\n".join([f"Examination: {self.verdict(self.runs)}", *found[:MOST_SHOWN], *more, also])

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.verdict(self.runs))}</p>{super()._repr_html_()}"

    @cached_property
    def contradictions(self) -> tuple[Statement, ...]:
        """Those statements that contradict."""
        return tuple(s for s in self.statements if s.code is not None)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """A finding for each contradiction."""
        return tuple(dict.fromkeys(s.finding for s in self.contradictions))

    @property
    def open_findings(self) -> tuple[Finding, ...]:
        """Those that nobody accepted."""
        return tuple(finding for finding in self.findings if finding.code not in self.accepted)

    def about(self, run: str) -> list[Statement]:
        """The contradictions of a run."""
        return [s for s in self.contradictions if s.run == run]

    def by_contradiction(self, runs: Iterable[str]) -> dict[tuple[str, str, str], list[str]]:
        """Those of ``runs`` that contradict, by subject, channels and code."""
        found: dict[tuple[str, str, str], list[str]] = {}
        for run in runs:
            channels: dict[tuple[str, str], dict[str, None]] = {}
            for s in self.about(run):
                channels.setdefault((s.subject, s.code or ""), {}).update({s.channel: None} if s.channel else {})
            for (subject, code), own in channels.items():
                found.setdefault((subject, first_of(own, 3), code), []).append(run)
        return found

    def doubts(self, runs: Collection[str], channel: str | None = None) -> tuple[str, ...]:
        """Codes that make a number doubtful which was made of ``runs``, and of a ``channel`` where it is of one."""
        codes = (s.code for s in self.contradictions if s.run in runs and s.concerns({channel}))
        return tuple(sorted({code for code in codes if code is not None}))

    def withheld(self, doubts: Iterable[str]) -> bool:
        """Whether a number with these doubts is withheld: they spoil it, and nobody accepted them."""
        return any(code in WITHHOLDING and code not in self.accepted for code in doubts)

    @property
    def copied(self) -> frozenset[str]:
        """Runs that are copies of another and count as none, unless that is accepted."""
        if "copied_run" in self.accepted:
            return frozenset()
        return frozenset(s.run for s in self.contradictions if s.code == "copied_run")

    def unwitnessed(self, run: str) -> list[str]:
        """Subjects of a run that no signal confirms."""
        about = [s for s in self.statements if s.run == run]
        heard = {s.subject for s in about}
        found = [subject for subject in WITNESSED if subject not in heard and (subject != "copy" or len(self.runs) < 2)]
        for sensor, channels in self.sensors.get(run, {}).items():
            axes, signs = ({s.channel for s in about if s.subject == subject} for subject in ("axis", "sign"))
            unsigned = [channel for channel in channels if channel not in signs]
            found += [f"axis of {sensor}"] if "axis" in heard and axes.isdisjoint(channels) else []
            if "sign" in heard and unsigned:
                found.append(f"sign of {sensor if len(unsigned) == len(channels) else ', '.join(unsigned)}")
        return found

    def why_unwitnessed(self, run: str) -> str:
        """Why no signal confirms them: what is contradicted of the run itself, else all witnesses that are silent."""
        reasons = self.reasons[run]
        return reasons.get(DOUBTED) or "; ".join(dict.fromkeys(reasons.values()))

    def decided(self, runs: Iterable[Run | SIRun]) -> "Examination":
        """The same with the codes accepted that are recorded as such for all of ``runs`` that contradict by them."""
        recorded = {(run, one.code) for one in decisions(runs) for run in one.runs}
        still_open = {s.code for s in self.statements if (s.run, s.code) not in recorded}
        return replace(self, accepted=self.accepted | ({code for _, code in recorded} - still_open))

    def verdict(self, shown: Sequence[str]) -> str:
        """In one sentence, of the runs ``shown``; and before it what changed where nobody knows which side is right."""
        if changes := list(dict.fromkeys(s.witnessed for run in shown for s in self.about(run) if s.is_of_one_side)):
            other = replace(self, statements=tuple(s for s in self.statements if not s.is_of_one_side))
            also = f" {other.verdict(shown)}" if any(map(other.about, shown)) else ""
            return f"{'; '.join(changes[:3])}{'; and others' * (len(changes) > 3)}.{also}"
        doubtful, unheard = [run for run in shown if self.about(run)], [run for run in shown if run in self.unexamined]
        if len(unheard) == len(shown):
            return f"None of {len(shown)} runs can be examined: nothing is known of them."
        if not doubtful:
            rest = f"; {len(unheard)} more cannot be examined" if unheard else ""
            return f"No contradiction in {len(shown) - len(unheard)} runs{rest}."
        each = [
            f"{first_of(runs, 3)} ({' of '.join(filter(None, (subject, channels)))})"
            for (subject, channels, _), runs in self.by_contradiction(doubtful).items()
        ]
        verb = f"contradict{'s' * (len(doubtful) == 1)}"
        which = "; ".join(each[:3]) + ("; and others" if len(each) > 3 else "")
        return f"{len(doubtful)} of {len(shown)} runs {verb} the run table, the rig or other runs: {which}."

    def document(self, shown: Sequence[str]) -> dict[str, Any]:
        """The runs ``shown`` as they stand in JSON."""
        runs = [
            {
                "run": run,
                "contradictions": [document(s) for s in self.about(run)],
                "statements": [document(s) for s in self.statements if s.run == run],
                "unwitnessed": self.unwitnessed(run),
                "silent": self.reasons[run],
            }
            for run in shown
            if run not in self.unexamined
        ]
        unexamined = {run: self.unexamined[run] for run in shown if run in self.unexamined}
        findings = [document(s.finding) for run in shown for s in self.about(run)]
        return {"verdict": self.verdict(shown), "runs": runs, "unexamined": unexamined, "findings": findings}


def examine(
    runs: Iterable[Run | SIRun],
    accepted: Iterable[str] = (),
    mechanism: Mechanism | None = None,
    pool: TaskPool = HERE,
) -> Examination:
    """Hear every witness of runs of one campaign; ``mechanism`` takes the place of the one that the rigs name.

    What a run shows is a task of the ``pool``.
    """
    tasks, known = list(runs), dict[object, Mechanism]()
    work = partial(observed_or_why, known=known, given=mechanism)
    return examined(tasks, pool.map(work, tasks, imports=True), accepted, pool)


def examined(
    runs: Sequence[Run | SIRun], seen: Sequence[Observation | str], accepted: Iterable[str] = (), pool: TaskPool = HERE
) -> Examination:
    """The examination of runs of one campaign by what each shows, or why nothing is known of it."""
    heard = hear([one for one in seen if not isinstance(one, str)], accepted, pool).decided(runs)
    return replace(
        heard, unexamined={run.name: one for run, one in zip(runs, seen, strict=True) if isinstance(one, str)}
    )


def hear(seen: Sequence[Observation], accepted: Iterable[str] = (), pool: TaskPool = HERE) -> Examination:
    """What the observations of runs of one campaign state, each for itself and against the others."""
    reasons = {one.name: one.reasons for one in seen}
    recordings = copies(seen, pool)
    statements = [*levels(seen), *(paths := encoder_paths(seen))]
    wrong = {s.run for s in paths if s.code == "encoder_contradiction"}
    statements += (short := record_ends(seen))
    cut = {s.run for s in short}  # of which a part of the motion is another than the whole
    statements = [s for s in statements if s.code != "motion_contradiction" or s.run not in cut]
    doubted = {run: "its encoders are contradicted, and nothing is examined along them" for run in wrong}
    doubted |= {s.run: "nothing else is examined of a part of the motion" for s in short}
    seen = [one.without_encoders() if one.name in wrong else one for one in seen if one.name not in cut]
    misstated = in_grams(seen)
    weighed = [one for one in seen if one.name not in {s.run for s in misstated}]
    statements += [*mechanisms(seen), *misstated, *(repeats := unlike_repeats(weighed))]
    for one in seen:
        statements += [*accelerations(one), *motions(one)]
    mixed = {s.run for s in repeats if s.because}
    about_masses, masses = mounted(weighed, {s.run for s in repeats if s.code}, mixed)
    about_payload, torque = payloads(weighed, masses)
    if torque is None:
        reasons |= {name: reasons[name] | {"payload": UNDETERMINED} for name in masses}
    statements += [*about_masses, *about_payload]
    unsure = frozenset(s.run for s in statements if s.code in CONDITIONS) | mixed
    doubted = {run: "its masses are contradicted, and the model has those of the run table" for run in unsure} | doubted
    doubted |= {run: "logs of it may be another run's" for run in mixed}
    reasons |= {run: {DOUBTED: why, **reasons[run]} for run, why in doubted.items()}
    flat = {(s.run, s.channel) for s in statements if s.code == "flat_channel"}
    found = examined_sensors(seen, unsure)
    statements += [s for s in found if s.code != "flat_channel" or (s.run, s.channel) not in flat]
    known = {(s.run, s.channel) for s in statements if s.code in {"axis_contradiction", "sign_contradiction"}}
    statements += repeated_vibration(sure := [one for one in seen if one.name not in unsure], known)
    statements += repeated_sizes(sure, {(s.run, s.channel) for s in statements if s.code in OF_CHANNELS})
    statements = _since(statements, list(reasons))
    said = _whose(recordings, statements)
    copied = {s.run for one, whose in zip(recordings, said, strict=True) if len(whose) < len(one.runs) for s in whose}
    statements = [replace(s, because="copied_run") if s.run in copied and s.code else s for s in statements]
    statements = [*(s for whose in said for s in whose), *statements]
    sensors = {
        one.name: {one.records[c[0]].column.sensor: c for c in one.vibrations if c[0] in one.records} for one in seen
    }
    return Examination(tuple(reasons), tuple(statements), reasons, torque, frozenset(accepted), sensors=sensors)


def _since(statements: Sequence[Statement], runs: Sequence[str]) -> list[Statement]:
    """The same; a sensor that contradicts in the last two runs or more that show it, and not before, changed there."""
    at, by_channel = {run: i for i, run in enumerate(runs)}, defaultdict[str | None, list[Statement]](list)
    for s in statements:
        by_channel[s.channel].append(s)
    found = []
    for s in statements:
        about = by_channel[s.channel] if s.channel and s.code else []
        wrong = {at[o.run] for o in about if (o.subject, o.code) == (s.subject, s.code)}
        right = {at[o.run] for o in about if o.code is None and s.subject.startswith(o.subject)} - wrong
        changed = len(wrong) > 1 and bool(right) and max(right) < min(wrong)
        found.append(replace(s, changed=f"{runs[max(right)]} and {runs[min(wrong)]}") if changed else s)
    return found


def _whose(recordings: Sequence[OneRecording], statements: Sequence[Statement]) -> list[list[Statement]]:
    """Of runs of one recording, whose it is: by what tells runs apart, by channels of its logs that fit one alone; else
    a run that holds another recording of others is believed last.
    """
    by_runs, copied = {s.run for s in statements if s.code in OTHER_RUNS}, set[str]()
    for _ in range(2):
        said = []
        for one in recordings:
            about = [s for s in statements if one.holds(s)]
            fitting = {s.channel for s in about if s.code is None and s.subject in {"axis", "sign", "gain"}}
            by_channels = {s.run for s in about if s.code in OF_CHANNELS and s.channel in fitting}
            said.append(one.statements(by_runs, by_channels, copied))
        pairs = zip(recordings, said, strict=True)
        copied = {s.run for one, whose in pairs if len(whose) < len(one.runs) for s in whose}
    return said


def observed_or_why(run: Run | SIRun, known: dict[object, Mechanism], given: Mechanism | None) -> Observation | str:
    """:func:`observed`, or why nothing is known of a run."""
    try:
        return observed(run, known, given)
    except CounterpoiseError as error:
        return str(error)


def observed(run: Run | SIRun, known: dict[object, Mechanism], given: Mechanism | None) -> Observation:
    """What a run shows. Raises CounterpoiseError of one without a rig, of which nothing is known.

    ``given`` takes the place of the mechanism that its rig names; those that were ``known`` are not read again.
    """
    bound = run if isinstance(run, SIRun) else SIRun.of(run)

    def mechanism() -> Mechanism:
        if given is not None:
            return given
        key = (bound.rig.mechanism, bound.recorded.inputs.get("mechanism"))
        if key[0] == NONE:
            raise AnalysisError("the rig names no mechanism")
        if key not in known:
            known[key] = mechanism_of(bound, None)
        return known[key]

    return observe(bound, mechanism)
