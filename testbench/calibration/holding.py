"""Which calibration holds for a sensor in a run: the newest record about that run, else the rig's own."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from . import stored
from .document import Calibration

if TYPE_CHECKING:
    from ..rig import Column, Rig
    from ..store import Run


@dataclass(frozen=True)
class Holding:
    """A calibration that holds, and where it is from."""

    sensor: str
    calibration: Calibration
    source: str
    """``rig``, or the name of the record."""
    written: str | None = None
    """When the record was written, ISO 8601, UTC."""
    reason: str | None = None
    runs: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """As it is printed."""
        return {
            "sensor": self.sensor,
            "calibration": str(self.calibration),
            "from": self.source,
            "written": self.written,
            "reason": self.reason,
            "runs": list(self.runs),
        }

    def __str__(self) -> str:
        since = "of the rig" if self.source == "rig" else f"recorded {(self.written or '')[:16]} UTC: {self.reason}"
        return f"{self.sensor}: {self.calibration} ({since})"


def of_column(run: "Run", column: "Column") -> Holding | None:
    """What holds for the sensor of a column in a run; None where nothing does."""
    record = stored.newest(run.path, column.sensor)
    if record is not None:
        return Holding(column.sensor, record.calibration, record.record, record.written, record.reason, (run.name,))
    if column.calibration is not None:
        return Holding(column.sensor, column.calibration, "rig", runs=(run.name,))
    return None


def of_runs(runs: "Iterable[Run]", rig: "Rig | None" = None) -> list[Holding]:
    """All that hold in runs, each once with its runs; ``rig`` in place of the ones that are stored with them."""
    from ..pairing import rig_of

    found: dict[tuple[str, str, str], Holding] = {}
    for run in runs:
        if rig is None and run.rig is None:
            continue
        known = rig or rig_of(run)
        recorded = [c for c in known.columns() if any(g.index(c.channel) is not None for g in run.groups)]
        for column in {c.sensor: c for c in recorded}.values():
            if (held := of_column(run, column)) is not None:
                key = (held.sensor, held.source, str(held.calibration))
                before = found.get(key)
                found[key] = held if before is None else replace(before, runs=(*before.runs, run.name))
    return sorted(found.values(), key=lambda holding: holding.sensor)
