"""Spectra of long records in blocks: densities, coherence, transmissibility, modes of the base."""

from .welch import Spectra, welch

__all__ = ["Spectra", "welch"]
