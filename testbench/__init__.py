"""Mechanics in the lab: logs to HDF5, reductions of vibration, and what is still unbalanced."""
