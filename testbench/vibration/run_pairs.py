"""Which runs of a campaign are compared with which: all conditions alike but the counter-masses."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..recording import Finding

if TYPE_CHECKING:
    from ..store import Run

_NEEDED = ("payload_kg", "motion", "peak_acceleration_g")


@dataclass(frozen=True)
class ConditionKey:
    """What two runs must have alike to be compared."""

    payload_kg: float
    motion: str
    peak_acceleration_g: float
    origin: str

    @classmethod
    def of(cls, run: "Run") -> "ConditionKey":
        """The key of a run whose conditions are complete."""
        c = run.conditions
        return cls(c["payload_kg"], c["motion"], round(c["peak_acceleration_g"], 9), run.origin)

    def __str__(self) -> str:
        return f"{self.payload_kg:g} kg, motion {self.motion}, {self.peak_acceleration_g:g} g0"


@dataclass(frozen=True)
class Pair:
    """Runs of one condition with one set of counter-masses, and without; several are repeats."""

    key: ConditionKey
    counter_masses: dict[str, float]
    """By site [kg]."""
    balanced: tuple["Run", ...]
    unbalanced: tuple["Run", ...]

    @property
    def runs(self) -> tuple["Run", ...]:
        """All runs, those with counter-masses first."""
        return (*self.balanced, *self.unbalanced)


def pairs(runs: Iterable["Run"]) -> tuple[list[Pair], list[Finding]]:
    """The pairs of a campaign, and what each run that is in none of them lacks.

    What was saved of a stopped ingest is in none where another run holds more of the same logs: no test counts twice.
    """
    runs = list(runs)
    groups: dict[ConditionKey, dict[tuple[tuple[str, float], ...], list[Run]]] = defaultdict(lambda: defaultdict(list))
    findings: list[Finding] = []
    for run in runs:
        if (whole := _held_by(runs, run)) is not None:
            twice = f"what was saved of a stopped ingest; {whole.name} holds more of the same logs: left out"
            findings.append(_about(run, "held_twice", twice))
        elif missing := [name for name in _NEEDED if name not in run.conditions]:
            lack = f"its conditions lack {', '.join(missing)}; put them into the sheet and ingest with --runs"
            findings.append(_about(run, "conditions_missing", lack))
        else:
            groups[ConditionKey.of(run)][_mounted(run)].append(run)
    found: list[Pair] = []
    for key, sets in groups.items():
        without = tuple(sets.pop((), ()))
        if sets and without:
            found += [Pair(key, dict(masses), tuple(some), without) for masses, some in sets.items()]
            continue
        lack = f"no {key.origin} run {'without' if sets else 'with'} counter-masses at {key} to compare it with"
        alone = [*without, *(run for some in sets.values() for run in some)]
        findings += [_about(run, "no_partner", lack) for run in alone]
    return found, findings


def _mounted(run: "Run") -> tuple[tuple[str, float], ...]:
    """Counter-masses that are on; a sheet that names none means none."""
    return tuple(sorted((site, mass) for site, mass in run.conditions.get("counter_masses", {}).items() if mass > 0.0))


def _held_by(runs: Sequence["Run"], part: "Run") -> "Run | None":
    """The run that holds most of the logs of which ``part`` was saved when their ingest was stopped, if not itself."""
    if not _is_part(part) or not part.provenance["sources"]:
        return None
    same = [run for run in runs if _logs(run) == _logs(part)]
    most = max(same, key=lambda run: (not _is_part(run), sum(group.samples for group in run.groups)))
    return None if most is part else most


def _is_part(run: "Run") -> bool:
    return any(finding.code == "interrupted" for finding in run.findings)


def _logs(run: "Run") -> list[tuple[str, int]]:
    """Names and sizes [bytes] of the logs that a run was made of."""
    return sorted((source["name"], source["size_bytes"]) for source in run.provenance["sources"])


def _about(run: "Run", code: str, message: str) -> Finding:
    return Finding(code, None, run.name, f"{run.name}: {message}")
