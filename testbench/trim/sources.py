"""What tells what is missing: force sensors, motor torques, vibration of the base, alone or by trial masses."""

from collections.abc import Callable

from ..rig.sensors import Torque
from .case import Case, Source, Told
from .vibration import states_base
from .ways import by_torque, by_trials, by_vibration, by_wrench

MORE_RUNS = (
    "add runs in another direction (the triangle), with more acceleration, or a second accelerometer on the base"
)
LONGER = "give longer runs that move more, or runs of several motions (x, y, triangle)"


def present(case: Case, one_mounting: bool) -> list[Source]:
    """The sources that the rig has for these runs; the base's vibration counts where there is nothing better."""
    rig = case.runs[0].rig
    if not one_mounting:
        return ["trials"]
    driven = {column.component for column in rig.columns_of(Torque)}
    found: list[Source] = ["wrench"] if rig.supports else []
    if driven and driven >= set(case.mounted.driven):
        found.append("torque")
    if not found and rig.base_accelerometers and states_base(rig):
        found.append("vibration")
    return found


def told_by(source: Source, case: Case) -> Told:
    """What a source tells. Raises AnalysisError, DataError or NotObservable, saying why, where it cannot tell."""
    return _WAYS[source](case)


_WAYS: dict[Source, Callable[[Case], Told]] = {
    "wrench": by_wrench, "torque": by_torque, "vibration": by_vibration, "trials": by_trials,
}  # fmt: skip
