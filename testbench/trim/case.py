"""What is asked of the runs, and what one source tells."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from balance.conditions import Conditions
from balance.estimation.first_moment_imbalance import Imbalance
from balance.mechanism import Mechanism

from ..findings import Finding
from ..motion.joint_motion import loaded

if TYPE_CHECKING:
    from ..clocks.mapping import ClockMap
    from ..rig import Rig
    from ..store import Run

Source = Literal["wrench", "torque", "vibration", "trials"]
NAMES: dict[Source, str] = {
    "wrench": "force sensors",
    "torque": "motor torques",
    "vibration": "vibration of the base, by the base that the rig states",
    "trials": "vibration of the base, by trial masses",
}


@dataclass(frozen=True)
class Case:
    """What is asked."""

    runs: "Sequence[Run]"
    rigs: "Sequence[Rig]"
    mechanism: Mechanism
    """Without payload and counter-masses."""
    conditions: Conditions
    """Of the mechanism as mounted in the first run."""
    sites: Sequence[str]
    cutoff: float | None
    """Highest frequency [Hz]; None: as is best for the source."""
    clocks: "Mapping[Path, Mapping[str, ClockMap]]"

    @property
    def mounted(self) -> Mechanism:
        """As mounted in the first run."""
        return loaded(self.runs[0], self.mechanism)

    @property
    def names(self) -> str:
        """Of the runs."""
        return ", ".join(run.name for run in self.runs)


@dataclass(frozen=True)
class Told:
    """What one source tells."""

    source: Source
    imbalance: Imbalance
    about: tuple[str, ...]
    """How it was found, for people."""
    doubts: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
