"""Signal processing of sampled channels: zero-phase filters, spectra, frequency responses, modes from free decay."""
