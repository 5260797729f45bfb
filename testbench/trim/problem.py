"""What is asked of the runs, and what one source tells."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from balance.balancing.conditions import Conditions
from balance.estimation.first_moment_imbalance import Imbalance
from balance.mechanism.mechanism import Mechanism

from ..recording import Finding
from ..runs.aligned_run import AlignedRun

Source = Literal["wrench", "torque", "vibration", "trials"]
NAMES: dict[Source, str] = {
    "wrench": "force sensors",
    "torque": "motor torques",
    "vibration": "vibration of the base, by the base that the rig states",
    "trials": "vibration of the base, by trial masses",
}


@dataclass(frozen=True)
class TrimProblem:
    """What is asked."""

    runs: Sequence[AlignedRun]
    conditions: Conditions
    """Of the mechanism as mounted in the first run."""
    sites: Sequence[str]
    cutoff: float | None
    """Highest frequency [Hz]; None: as is best for the source."""

    @property
    def mechanism(self) -> Mechanism:
        """Without payload and counter-masses."""
        return self.runs[0].unloaded

    @property
    def mounted(self) -> Mechanism:
        """As mounted in the first run."""
        return self.runs[0].mechanism

    @property
    def names(self) -> str:
        """Of the runs."""
        return ", ".join(run.name for run in self.runs)


@dataclass(frozen=True)
class SourceEstimate:
    """What one source estimates."""

    source: Source
    imbalance: Imbalance
    about: tuple[str, ...]
    """How it was found, for people."""
    doubts: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
