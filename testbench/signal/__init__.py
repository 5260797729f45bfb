"""Signal processing of sampled channels: zero-phase filters, spectra, frequency responses, modes from free decay."""

from .welch import Spectra, welch

__all__ = ["Spectra", "welch"]
