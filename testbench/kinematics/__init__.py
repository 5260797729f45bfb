"""Motion of a run from its records: derivatives of positions, joints by encoders, the base, recognised motions."""
