"""Spectrum of the base's acceleration."""

from typing import TYPE_CHECKING

import numpy as np

from ..errors import AnalysisError
from ..levels import levels
from ..runs.si_run import SIRun
from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..store import Run

LOWEST, HIGHEST = 1.0, 500.0
"""Frequencies that are shown [Hz]."""


def base_spectrum(run: "Run") -> "Figure":
    """Power spectral density of the base's acceleration along each axis, with the frequencies where it peaks."""
    si = SIRun.of(run)
    found = [(level, level.spectrum) for level in levels(si, si.rig.base_columns)]
    shown = [(level, spectrum) for level, spectrum in found if spectrum is not None]
    if not shown:
        raise AnalysisError(f"{run.name}: no accelerometer on the base with a record long enough for a spectrum")
    with style.styled():
        figure, panels = style.grid(len(shown), 1, 1.7, sharex=True)
        for axes, (level, spectrum) in zip(panels[:, 0], shown, strict=True):
            inside = (spectrum.frequency >= LOWEST) & (spectrum.frequency <= HIGHEST)
            axes.loglog(spectrum.frequency[inside], spectrum.power()[inside], color=style.ANALYSED)
            for peak in level.peaks():
                if LOWEST <= peak["frequency_hz"] <= HIGHEST:
                    axes.plot(peak["frequency_hz"], peak["density_si2_hz"], "v", color=style.WITHOUT, ms=4.0)
                    axes.annotate(
                        f"{peak['frequency_hz']:.1f}", (peak["frequency_hz"], peak["density_si2_hz"]), fontsize=7
                    )
            axes.set_ylabel(f"{level.column.component} [(m/s2)2/Hz]")
        panels[-1, 0].set_xlabel("frequency [Hz]")
        resolution = float(np.diff(shown[0][1].frequency[:2])[0])
        style.title(
            figure, f"Spectrum of the base's acceleration, Welch, Hann window, {resolution:.3g} Hz apart", [run]
        )
    return figure
