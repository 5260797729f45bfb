"""Calibrations: from what a logger wrote to SI, computed on reading; a corrected one is a later record."""
