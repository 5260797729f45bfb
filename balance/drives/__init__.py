"""Drives: one-degree-of-freedom machines whose crank a motor turns; start-up, steady state, fluctuation of speed."""
