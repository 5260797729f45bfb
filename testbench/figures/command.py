"""How well the commanded acceleration was reached."""

from typing import TYPE_CHECKING

import numpy as np

from balance.loading.loading import load_mechanism
from balance.mechanism import Mechanism
from balance.quantities import G0

from ..command import BANDWIDTH_HZ, performance
from ..motion.segments import moving
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..store import Run


def command_performance(run: "Run", mechanism: Mechanism | None = None, bandwidth_hz: float = BANDWIDTH_HZ) -> "Figure":
    """Acceleration of the platform by accelerometer, by encoders and as commanded, and how far both are from it.

    ``mechanism`` turns joint angles into the platform's motion; by default the one that the rig names.
    """
    si = SIRun.of(run)
    shown = performance(AlignedRun(si, mechanism or load_mechanism(si.rig.mechanism)), bandwidth_hz)
    axes_moved = [axis for axis, values in shown.target.items() if np.ptp(values) > 0.0] or list(shown.target)
    with style.styled():
        figure, panels = style.grid(2 * len(axes_moved), 1, 1.9, sharex=True)
        for i, axis in enumerate(axes_moved):
            above, below = panels[2 * i, 0], panels[2 * i + 1, 0]
            lines = (
                (f"accelerometer, below {bandwidth_hz:g} Hz", shown.accelerometer[axis], style.ACCELEROMETER),
                (f"encoders, differentiated below {bandwidth_hz:g} Hz", shown.encoders[axis], style.ENCODERS),
            )
            for label, every, colour in lines:
                values = np.where(shown.kept, every, np.nan)
                above.plot(shown.time, values / G0, color=colour, label=label)
                below.plot(shown.time, (values - shown.target[axis]) / G0, color=colour)
            target = np.where(shown.kept, shown.target[axis], np.nan)
            above.plot(shown.time, target / G0, color=style.TARGET, lw=0.9, ls="--", label="target")
            above.set_ylabel(f"{axis} [g0]")
            below.set_ylabel(f"{axis} less target [g0]")
        span = moving(shown.target[axes_moved[0]], 1.0 / float(shown.time[1] - shown.time[0]))
        panels[-1, 0].set_xlim(shown.time[span][0], shown.time[span][-1])
        panels[-1, 0].set_xlabel(
            f"time of the controller [s]; accelerometer shifted by {1e3 * shown.lag_s:.1f} ms, found by correlation"
        )
        style.legend(figure, panels[0, 0])
        style.title(figure, "Acceleration command", [run])
    return figure
