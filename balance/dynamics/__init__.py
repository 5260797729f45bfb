"""Loads, momentum and motion of mechanisms: direct, as regressors, forward in time, and on a base that moves."""
