"""Which runs of a campaign are compared: those whose conditions are equal but for the counter-masses."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from balance.results import Key
from balance.units import G0

from ..campaign_plan import PlannedRun
from ..recording import Conditions, Finding, mounted_masses, payload_body, with_one_payload
from ..store.ledger import read_ledger

if TYPE_CHECKING:
    from ..store import Run

_COMPARED = ("payload_kg", "motion", "peak_acceleration_g", "peak_acceleration_rad_s2")
"""Conditions that two runs must state; one that no run of a campaign states is not needed, the motion excepted."""


def masses_text(masses: Mapping[str, float]) -> str:
    """``tool 0.5 kg, tip 0.1 kg``."""
    return ", ".join(f"{name} {mass:g} kg" for name, mass in masses.items())


@dataclass(frozen=True)
class ConditionKey:
    """Conditions that two runs must share to be compared."""

    payload_kg: Annotated[float | None, Key("", "payload kg", "g")]
    """None where no run states one."""
    motion: Annotated[str, Key("", "motion")]
    peak_acceleration_g: Annotated[float | None, Key("", "peak g0", "g")]
    """Of a point [g0]; None where no run states one."""
    origin: Annotated[str, Key("", "origin")]
    peak_acceleration_rad_s2: Annotated[float | None, Key("", "peak rad/s2", "g")] = None
    """Of joints that turn [rad/s2]; None where no run states one."""
    payloads: tuple[tuple[str, float], ...] = ()
    """By body or site, above zero, in the order of their names [kg]; of one that is not named as its file has it."""

    @property
    def payloads_kg(self) -> Annotated[dict[str, float], Key("", "payloads", masses_text)]:
        """By body or site [kg]."""
        return dict(self.payloads)

    @classmethod
    def of(cls, run: "Run") -> "ConditionKey":
        """The key of a run; its motion is empty where none is stated."""
        c = stated_of(run)
        peaks = (c.get("peak_acceleration_g"), c.get("peak_acceleration_rad_s2"))
        linear, turning = (None if peak is None else round(peak, 9) for peak in peaks)
        return cls(
            c.get("payload_kg"),
            c.get("motion", ""),
            linear,
            run.origin,
            turning,
            _in_order(c, "payloads"),
        )

    def planned(self, name: str, counter_masses: Mapping[str, float]) -> PlannedRun:
        """A run of this condition with these counter-masses [kg], to be simulated."""
        linear, turning = self.peak_acceleration_g, self.peak_acceleration_rad_s2
        peak = turning if linear is None else linear * G0
        return PlannedRun(
            name, self.payload_kg, dict(counter_masses), self.motion, peak, 1, turning is not None, dict(self.payloads)
        )

    def __str__(self) -> str:
        stated = {" kg": self.payload_kg, " g0": self.peak_acceleration_g, " rad/s2": self.peak_acceleration_rad_s2}
        payload, *peaks = ("" if value is None else f"{value:g}{unit}" for unit, value in stated.items())
        motion = " ".join(dict.fromkeys(("motion", self.motion)))  # one of that name is named once
        return ", ".join(filter(None, (payload, masses_text(self.payloads_kg), motion, *peaks)))


@dataclass(frozen=True)
class Pair:
    """Runs of one condition with one set of counter-masses, and without; several on a side are repeats."""

    key: ConditionKey
    counter_masses: dict[str, float]
    """Counter-mass by site [kg]."""
    balanced: tuple["Run", ...]
    unbalanced: tuple["Run", ...]

    @property
    def runs(self) -> tuple["Run", ...]:
        """All runs, those with counter-masses first."""
        return (*self.balanced, *self.unbalanced)


def pairs(runs: Iterable["Run"]) -> tuple[list[Pair], list[Finding]]:
    """The pairs of a campaign, and a finding for each run that is in none of them, or could not be stored.

    A run recovered from a stopped ingest is left out where another run holds more of the same logs: none counts twice.
    """
    runs = list(runs)
    groups: dict[ConditionKey, dict[tuple[tuple[str, float], ...], list[Run]]] = defaultdict(lambda: defaultdict(list))
    needed = [name for name in _COMPARED if name == "motion" or any(name in run.conditions for run in runs)]
    ledgers = {folder: read_ledger(folder) for folder in sorted({run.path.parent for run in runs})}
    findings = [finding for ledger in ledgers.values() for finding in ledger.lacking]
    for run in runs:
        if run.path.name in ledgers[run.path.parent].grown:
            more = "its log has grown since it was stored: ingest it again, which stores its next version"
            findings.append(_finding(run, "incomplete", more))
        if (whole := _fuller_run(runs, run)) is not None:
            twice = f"left out: recovered from a stopped ingest, and {whole.name} holds more of the same logs"
            findings.append(_finding(run, "held_twice", twice))
        elif missing := [name for name in needed if name not in stated_of(run)]:
            lack = f"its conditions lack {', '.join(missing)}: add them to the run table and ingest with --runs"
            findings.append(_finding(run, "conditions_missing", lack))
        else:
            groups[ConditionKey.of(run)][_in_order(run.conditions, "counter_masses")].append(run)
    found: list[Pair] = []
    for key, sets in groups.items():
        without = tuple(sets.pop((), ()))
        if sets and without:
            found += [Pair(key, dict(masses), tuple(some), without) for masses, some in sets.items()]
            continue
        lack = f"no {key.origin} run {'without' if sets else 'with'} counter-masses at {key} to compare it with"
        alone = [*without, *(run for some in sets.values() for run in some)]
        findings += [_finding(run, "no_partner", lack) for run in alone]
    return found, findings


def stated_of(run: "Run") -> Conditions:
    """The conditions of a run, of the one body that its stored mechanism names as its payload as ``payload_kg``."""
    return with_one_payload(run.conditions, payload_body(run.inputs))


def _in_order(stated: Conditions, key: Literal["payloads", "counter_masses"]) -> tuple[tuple[str, float], ...]:
    """Masses above zero in the order of their names [kg]."""
    return tuple(sorted(mounted_masses(stated, key).items()))


def _fuller_run(runs: Sequence["Run"], part: "Run") -> "Run | None":
    """For a run recovered from a stopped ingest: another run that holds more of the same logs, if there is one."""
    if not _is_recovered(part) or not part.provenance["sources"]:
        return None
    same = [run for run in runs if _log_sizes(run) == _log_sizes(part)]
    most = max(same, key=lambda run: (not _is_recovered(run), sum(group.samples for group in run.groups)))
    return None if most is part else most


def _is_recovered(run: "Run") -> bool:
    return any(finding.code == "interrupted" for finding in run.findings)


def _log_sizes(run: "Run") -> list[tuple[str, int]]:
    """Names and sizes [bytes] of the logs of a run."""
    return sorted((source["name"], source["size_bytes"]) for source in run.provenance["sources"])


def _finding(run: "Run", code: str, message: str) -> Finding:
    return Finding(code, None, run.name, f"{run.name}: {message}")
