"""Force, moment and drive torque of a linkage over time, before and after balancing."""

from typing import TYPE_CHECKING

from ..linkages.printed import COLUMNS
from ..linkages.verification import Verification

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LABEL = {
    "Fx_N": "force FX [N]",
    "Fy_N": "force FY [N]",
    "Mz_Nm": "moment M [N m]",
    "torque_Nm": "drive torque [N m]",
}
_STAGE = {
    "before": ("before", "#555555", "-"),
    "force": ("counter-masses", "#3b6ea5", "-"),
    "complete": ("and gears", "#e07a3f", "--"),
}
"""Label, colour and line: dashed, as it lies on the one of counter-masses where both are zero."""


def draw_stages(check: Verification, title: str = "") -> "Figure":
    """Time series of all stages, at constant speed on the left and at varying speed on the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 8.4), layout="constrained")
    panels = figure.subplots(len(COLUMNS), 2, sharey="row", sharex="col")
    for column, (label, run) in enumerate(zip(check.labels, (check.constant, check.varying), strict=True)):
        for row, quantity in enumerate(COLUMNS):
            axes = panels[row, column]
            for stage in run.responses:
                name, colour, line = _STAGE[stage]
                axes.plot(run.trajectory.time, run.series(stage)[quantity], line, color=colour, label=name, lw=1.4)
            axes.grid(alpha=0.25)
        panels[0, column].set_title(label)
        panels[-1, column].set_xlabel("time [s]")
    for row, quantity in enumerate(COLUMNS):
        panels[row, 0].set_ylabel(_LABEL[quantity])
    panels[0, 0].legend(fontsize=8)
    figure.suptitle(f"{title} (simulated)".strip())
    return figure
