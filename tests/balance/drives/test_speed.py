"""How quickly the steady state is found."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_at_least_twenty_times_faster_than_integrating_to_it():
    """At 828 rev/min, periodic to 1e-8, against DOP853 at rtol 1e-10 from standstill; the extremes agree."""
    command = [sys.executable, "-m", "benchmarks.drive", "--rounds", "3"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
