"""Signal processing of sampled channels: zero-phase filters, spectra, frequency responses, modes from free decay."""

from typing import Literal, get_args

Metric = Literal["peak", "peak_to_peak", "rms"]
"""What an amplitude is."""
METRIC_NAMES: tuple[Metric, ...] = get_args(Metric)
