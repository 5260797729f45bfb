"""Log files into stored runs: read, checked and written in one pass and bounded memory, whole or not at all.

The outcome of each file says what became of it: stored, stored already, refused and why, or waiting.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import count
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, Any

from balance.results import Key

from ..errors import NotConfirmedError, RecordingError, StoreError
from ..quality import rig_checks
from ..quality.group_checks import GroupCheck, RecordingCheck
from ..readers import ReadOptions
from ..recording import Finding, Origin, Refusal, findings_by_group, refusing_findings
from ..store import atomic_files, ledger, open_run
from ..store.campaign import CONTINUES, StoredSources
from ..store.writer import RunWriter
from .log_sources import LogReading, Source, distinct_groups, refuse_stored_run, refuse_too_many, refuse_twice
from .planned_runs import PlannedRun

if TYPE_CHECKING:
    from ..rig import Rig
    from ..store.run import Run

_ANEW = "stored runs never change: take it out by testbench remove, with the reason, and ingest again"


@dataclass(frozen=True)
class Outcome:
    """What became of one log file, and the run's file.

    ``stored``, ``already_stored``, ``refused``, ``waiting``, or ``missing``: the run table names it, and it is
    neither given nor stored as that run.
    """

    file: Annotated[str | None, Key("", "run")]
    source: Annotated[str, Key("", "log")]
    sha256: Annotated[str | None, Key()]
    origin: Annotated[Origin, Key("", "origin")]
    status: Annotated[str, Key("", "status")]
    findings: Annotated[tuple[Finding, ...], Key("", "findings", lambda found: str(sum(f.severity > 0 for f in found)))]
    message: str = ""
    may_pass: bool = False
    """Whether the disk or share failed, which may be over soon, and not the log."""


def not_stored(planned: PlannedRun, sources: Sequence[Source], error: Exception) -> list[Outcome]:
    """One outcome for each file of a run that was not stored; the reason goes with the file that it names."""
    outcomes = []
    for i, path in enumerate(planned.files):
        findings = tuple(sources[i].findings) if i < len(sources) else ()
        if isinstance(error, Refusal) and str(error).startswith(path.name):
            findings = (*findings, error.finding)
        elif not refusing_findings(findings):
            findings = (*findings, Finding("not_stored", None, None, str(error)))
        sha256 = sources[i].sha256 or None if i < len(sources) else None
        simulated = any(source.recording.origin == "simulated" for source in sources)
        origin = "simulated" if simulated else planned.origin or "unstated"
        cause = error.__cause__
        may_pass = isinstance(cause, OSError) and not isinstance(cause, FileExistsError | FileNotFoundError)
        outcomes.append(Outcome(None, path.name, sha256, origin, "refused", findings, str(error), may_pass))
    return outcomes


Progress = Callable[[int], None]
"""Called with the bytes that were read since the last call."""


@dataclass(frozen=True)
class Ingest:
    """How log files become runs of the campaign in ``folder``.

    ``accepted`` are codes of findings that a person accepts; the decision is stored with the run.
    """

    folder: Path
    rig: "Rig | None" = None
    options: ReadOptions | None = None
    accepted: frozenset[str] = frozenset()
    acceptance: Mapping[str, str] | None = None
    """Who accepts them, ``by``, and the ``reason``; None: nobody says so."""
    progress: Progress = lambda count: None
    sibling_log: Callable[[Collection[str]], str | None] = lambda channels: None
    """Names a log outside the run, given to the same command, that holds one of these channels."""
    reading: LogReading = field(default_factory=LogReading)
    """How each log is read, by the options and by the rig."""
    _stored: StoredSources = field(init=False)

    def __post_init__(self) -> None:
        if not self.reading.is_of(self.options, self.rig):
            object.__setattr__(self, "reading", LogReading(self.options, self.rig))
        object.__setattr__(self, "_stored", StoredSources(self.folder))

    def run(self, planned: PlannedRun) -> list[Outcome]:
        """Ingest one run; one outcome for each of its files. The run is stored whole or not at all.

        That a run of the run table could not be stored is entered into the ledger of the campaign.
        """
        outcomes = self._run(planned)
        own = (
            one.file and (one.status == "stored" or self._stored.is_version(one.file, planned.name)) for one in outcomes
        )
        if planned.conditions is not None and not any(own):
            reason = "; ".join(dict.fromkeys(one.message or one.status for one in outcomes if one.status != "missing"))
            with suppress(OSError, StoreError):  # of a folder that cannot be written the outcomes tell
                ledger.enter_not_stored(self.folder, f"{planned.name}.h5", reason or "its log was not given")
        return outcomes

    def _run(self, planned: PlannedRun) -> list[Outcome]:
        absent, sources = self._not_given(planned), list[Source]()
        if lacking := [outcome.source for outcome in absent if outcome.status == "missing"]:
            given = ", ".join(path.name for path in planned.files)
            reason = RecordingError(f"{given}: waits for {', '.join(lacking)}, of the same run {planned.name!r}")
            return [*absent, *not_stored(planned, (), reason)]
        try:
            if planned.problem and not absent:
                raise RecordingError(planned.problem)
            for path in planned.files:
                sources.append(Source(path, self.reading))
                refuse_stored_run(sources[-1])
                refuse_too_many(sources[-1], sources[-1].recording.groups)
            for source, recording in zip(sources, distinct_groups([s.recording for s in sources]), strict=True):
                source.recording = recording
            if absent:
                return [*absent, *self._already(planned, sources)]
            if (begun := self._begun(sources)) is not None:
                versions = (f"{self._stored.named(begun)}.v{number}" for number in count(2))
                name = next(name for name in versions if not (self.folder / f"{name}.h5").exists())
                return self._stored_anew(replace(planned, name=name), sources, begun)
            return self._already(planned, sources) or self._stored_anew(planned, sources)
        except (RecordingError, StoreError) as error:
            return [*absent, *not_stored(planned, sources, error)]
        except OSError as error:
            failure = RecordingError(f"{error.filename}: {error.strerror or error}")
            failure.__cause__ = error
            return [*absent, *not_stored(planned, sources, failure)]

    def _begun(self, sources: Sequence[Source]) -> str | None:
        """The stored run of these logs as they were when they were shorter, proven by its digests of them."""
        self._stored.look()
        begun = [self._stored.begun_run(source.path, source.size) for source in sources]
        if not any(begun):
            return None
        found = {
            run or self._stored.run_of(source.size, source.digested())
            for source, run in zip(sources, begun, strict=True)
        }
        return found.pop() if len(found) == 1 else None

    def _stored_anew(self, planned: PlannedRun, sources: Sequence[Source], begun: str | None = None) -> list[Outcome]:
        """Store the run, unless another process was quicker with the same recordings."""
        try:
            return self._store(planned, sources, begun)
        except NotConfirmedError:
            raise
        except StoreError:
            if others := self._already(planned, sources, begun):
                return others
            if (reason := self._stored.unopened.get(f"{planned.name}.h5")) is not None:
                raise StoreError(_unopened(f"{planned.name}.h5", reason, "it has the name of this run")) from None
            if changed := list(filter(None, (self._changed(planned, source) for source in sources))):
                raise StoreError("; ".join(changed)) from None
            raise

    def _not_given(self, planned: PlannedRun) -> list[Outcome]:
        """Outcomes of logs that the run table names and that are not given: stored with the run already, or missing."""
        if not planned.missing:
            return []
        self._stored.look()
        run, outcomes = self._stored.newest(planned.name), list[Outcome]()
        stored = open_run(self.folder / run) if run else None
        for name in planned.missing:
            content = run and self._stored.content_of(PurePath(name).name, run)
            if stored is not None and content:
                found, message = tuple(self._differs(planned, stored)), f"was not given, and is stored already in {run}"
                outcomes.append(Outcome(run, name, content[1], stored.origin, "already_stored", found, message))
                continue
            message = f"is of run {planned.name} by the run table, and was not given: ingest it when it is there"
            if len(others := self._stored.made_of(PurePath(name).name)) == 1:
                message += (
                    f"; {others.pop()} was made of a log of this name: if it is that one, rows of the run table were "
                    "exchanged or renamed since it was stored: correct them"
                )
            finding = Finding("log_missing", None, None, message)
            outcomes.append(Outcome(None, name, None, planned.origin or "unstated", "missing", (finding,), message))
        return outcomes

    def _already(self, planned: PlannedRun, sources: Sequence[Source], begun: str | None = None) -> list[Outcome]:
        """The outcomes if the campaign holds these recordings already; none if it holds none of them.

        What it holds in the run that they have ``begun`` does not count. Raises StoreError if it holds some of them.
        """
        self._stored.look()
        if not planned.missing and not self._stored.any_of_size({source.size for source in sources}):
            return []
        runs = [self._stored.run_of(source.size, source.digested()) for source in sources]
        known = [(source, run) for source, run in zip(sources, runs, strict=True) if run not in {None, begun}]
        if not known and not planned.missing:
            return []
        outcomes, odd = list[Outcome](), list[str]()
        for source, run in known:
            assert run is not None
            there = Finding("already_stored", None, None, f"is stored already as {run}; nothing was written")
            stored, name = open_run(self.folder / run), source.path.name
            found = self._differs(planned, stored)
            if not self._stored.is_version(run, planned.name) and (twin := _one_recording(source, stored)):
                found = [replace(one, message=twin) if one.code == "conditions_differ" else one for one in found]
            odd += [one.message for one in found if one.code == "conditions_differ"]
            outcomes.append(
                Outcome(run, name, source.sha256, stored.origin, "already_stored", (there, *found), there.message)
            )
        if len(known) == len(sources):
            return outcomes
        known_sources = [source for source, _ in known]
        odd += filter(None, (self._changed(planned, source) for source in sources if source not in known_sources))
        names = ", ".join(s.path.name for s in known_sources) or ", ".join(planned.missing)
        raise StoreError(
            "; ".join(odd) or f"{names}: stored already, but not with the other files of this run; {_ANEW}"
        )

    def _changed(self, planned: PlannedRun, source: Source) -> str | None:
        """That a log is no longer what the stored run of this name was made of, since when, and what to do; or None."""
        run, log = self._stored.newest(planned.name), source.path.name
        if run is None or (content := self._stored.content_of(log, run)) is None:
            return None
        written = open_run(self.folder / run).provenance["written"]
        changed = datetime.fromtimestamp(source.path.stat().st_mtime, UTC).isoformat(timespec="seconds")
        has_grown = planned.missing and self._stored.begun_run(source.path, source.size) == run
        return (
            f"{log} is no longer the file of which {run} was made at {written}: {content[0]} bytes, SHA-256 "
            f"{content[1][:12]}... then, {source.size} bytes, {source.digested()[:12]}... now, changed at {changed}; "
            + (f"it has grown: give {', '.join(planned.missing)} too, and the run is stored anew as its next version"
               if has_grown else _ANEW)
        )  # fmt: skip

    def _differs(self, planned: PlannedRun, stored: "Run") -> list[Finding]:
        """Where rig or run table say something else than what is stored with a run, which never changes."""
        run, found = stored.path.name, list[Finding]()
        if self.rig is not None and (stored.rig or "") != self.rig.text:
            message = (
                f"{run} was stored with{' another' if stored.rig else 'out a'} rig, and keeps what it has: ingest into "
                "another folder (-o); a calibration alone is corrected by testbench calibrate"
            )
            found.append(Finding("rig_differs", None, None, message))
        if planned.conditions is None:
            return found
        from .run_table import condition_cells  # late: a log alone needs no model of a table

        named = planned.name if self._stored.is_version(run, planned.name) else stored.name
        says_simulated = any(source.get("origin") == "simulated" for source in stored.provenance["sources"])
        origin = "simulated" if says_simulated and planned.origin != "measured" else planned.origin or "unstated"
        now = {"run": planned.name, "origin": origin, **condition_cells(planned.conditions)}
        then = {"run": named, "origin": stored.origin, **condition_cells(stored.conditions)}
        if changed := [name for name in now | then if now.get(name) != then.get(name)]:
            said = ", ".join(f"{name} {then.get(name) or 'empty'} (now {now.get(name) or 'empty'})" for name in changed)
            message = (
                f"{run} is stored with other values than the run table has: {said}; correct the table, or take {run} "
                "out by testbench remove, with the reason, and ingest again"
            )
            found.append(Finding("conditions_differ", None, None, message))
        return found

    def _store(self, planned: PlannedRun, sources: Sequence[Source], begun: str | None) -> list[Outcome]:
        origin = _origin(planned, sources)
        if begun is not None:
            message = f"continues {begun}, which holds the beginning of the log: analyses take this run instead"
            sources[0].findings.append(Finding("continued", None, None, message))
        conditions, rig = planned.conditions or {}, None if self.rig is None else self.rig.text
        inputs: dict[str, tuple[str, ...]] = {}
        motion: rig_checks.Motion = None
        if self.rig is not None or "motion" in conditions:
            from .run_inputs import motion_duration, run_inputs  # late: a log alone needs none of it

            folders = [planned.folder, None if self.rig is None else self.rig.folder]
            inputs, lacking = run_inputs(self.rig, conditions, [folder for folder in folders if folder is not None])
            motion = motion_duration(inputs, conditions)
            sources[0].findings.extend(lacking)
        # What `testbench recover` must know if this process is killed.
        intent = {"origin": origin, "conditions": conditions, "rig": rig, "inputs": inputs,
                  "sources": [source.provenance() for source in sources]}  # fmt: skip
        with RunWriter(self.folder, planned.name, intent) as writer:
            checks = [self._copy(source, writer) for source in sources]
            every = [check for own in checks for check in own]
            measured = set() if self.rig is None else {column.channel for column in self.rig.columns()}
            for source, own in zip(sources, checks, strict=True):
                found = rig_checks.with_units_confirmed(source.findings, every, self.rig, motion)
                found += rig_checks.duration_findings(own, measured, motion)
                source.findings = findings_by_group(found, [check.group for check in own], len(every) > 1)
            if self.rig is not None:
                recordings = [source.recording for source in sources]
                sources[0].findings.extend(rig_checks.rig_findings(self.rig, recordings, self.sibling_log))
                sources[0].findings.extend(rig_checks.of_conditions(self.rig, conditions))
            doubt = "whether it holds this recording too is not known"
            for name, reason in self._stored.unopened.items():
                sources[0].findings.append(Finding("run_not_opened", None, None, _unopened(name, reason, doubt)))
            everything = [finding for source in sources for finding in source.findings]
            if grave := refusing_findings(everything, self.accepted):
                codes = list(dict.fromkeys(finding.code for finding in grave))
                raise RecordingError(
                    f"{planned.name}: refused for {', '.join(codes)}: correct what the findings name, or store it as "
                    f"it is with {' '.join(f'--accept {code}' for code in codes)}"
                )
            refuse_twice([(source.digested(), source.path.name) for source in sources])
            writer.describe(origin, conditions, everything, self._provenance(sources, begun), rig, inputs)
            writer.seal()
            with atomic_files.one_at_a_time(self.folder):
                if others := self._already(planned, sources, begun):
                    return others
                target = writer.commit().name
        return [Outcome(target, s.path.name, s.sha256, origin, "stored", tuple(s.findings)) for s in sources]

    def _copy(self, source: Source, writer: RunWriter) -> list[GroupCheck]:
        """Read one file to its end, checking and writing each block; the checks of the groups that it held."""
        check = RecordingCheck(source.recording, rig_checks.channel_ranges(self.rig, source.recording))
        source.findings += self.reading.checked(source.description, source.recording.findings)
        done, groups = 0, len(check.groups)
        with ThreadPoolExecutor(1) as pool:  # one block is written while the next one is checked
            writing = pool.submit(lambda: None)
            for block in source.recording.blocks(source.findings.append):
                check.update(block)
                if len(check.groups) > groups:
                    groups = len(check.groups)
                    refuse_too_many(source, [known.group for known in check.groups.values()])
                writing.result()
                writing = pool.submit(writer.group(block.group).append, block.columns)
                self.progress(block.bytes_read - done)
                done = block.bytes_read
            writing.result()
        source.findings += rig_checks.without_commanded(self.rig, source.recording, check.findings())
        source.findings += rig_checks.rate_findings(self.rig, check.groups.values())
        if not any(group.samples for group in check.groups.values()):
            raise Refusal(source.path.name, Finding("no_data", None, None, "holds no sample that can be kept"))
        if source.description is not None:
            source.findings = source.description.with_normal_as_notes(source.findings)
        for group in check.groups.values():
            writer.group(group.group).finish(group.rate_hz, group.rate_source, group.start_time)
        return list(check.groups.values())

    def _provenance(self, sources: Sequence[Source], begun: str | None) -> dict[str, Any]:
        accepted = sorted(self.accepted & {finding.code for source in sources for finding in source.findings})
        return {
            **({} if begun is None else {CONTINUES: begun}),
            "software": {name: version(name) for name in ("counterpoise", "h5py", "numpy")},
            "written": datetime.now(UTC).isoformat(timespec="seconds"),
            "accepted_findings": accepted,
            **({"acceptance": dict(self.acceptance)} if accepted and self.acceptance else {}),
            "sources": [source.provenance() for source in sources],
        }


def _origin(planned: PlannedRun, sources: Sequence[Source]) -> Origin:
    """Simulated if a log says so, which the run table must not contradict; measured if the run table alone says so."""
    simulated = [source for source in sources if source.recording.origin == "simulated"]
    if simulated and planned.origin == "measured":
        message = "the log says that it is simulated, the run table says measured; mend the run table"
        raise Refusal(simulated[0].path.name, Finding("origin_contradiction", None, None, message))
    return "simulated" if simulated else planned.origin or "unstated"


def _one_recording(source: Source, stored: "Run") -> str:
    """That a log and that of another run hold the same bytes under two names, and what to do; empty of one name."""
    log = next(one["name"] for one in stored.provenance["sources"] if one["sha256"] == source.sha256)
    if log == source.path.name:
        return ""
    run = stored.path.name
    return (
        f"{log} and {source.path.name} are one recording (byte for byte), stored as {run}: bring the missing log of "
        f"one of them; if it is that of {log}, take {run} out by testbench remove, with the reason; and ingest again"
    )


def _unopened(name: str, reason: str, consequence: str) -> str:
    return (
        f"{name} of the campaign cannot be opened, and {consequence} ({reason}); `testbench verify` tells whether it "
        "is damaged: then `testbench remove` takes it out of the campaign, and its logs are to be ingested again"
    )
