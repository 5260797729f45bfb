"""Benchmarks against named peers: ours and the peer in turn, in one run, the same work, results compared first."""
