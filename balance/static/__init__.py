"""Static balance: potential energy constant over the workspace, by counter-masses or by zero-free-length springs."""
