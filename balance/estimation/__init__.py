"""Unknowns from readings: weighted least squares, what it can identify, and how sure the estimates are."""
