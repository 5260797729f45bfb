"""An accelerometer that clipped only with, or only without counter-masses: what the reduction says is a bound."""

from dataclasses import replace

import numpy as np
import pytest

from balance.results import document
from studies import simulated_runs as memory
from testbench.recording import Finding
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import analyze

TOP = 0.6
"""At which share of its largest value the channel clips."""


@pytest.fixture(scope="module")
def runs():
    """A run with counter-masses and one without."""
    return memory.scene("x").run(0), memory.scene("x", masses={}).run(1)


def clipped(run):
    """The run with AccX at the end of its range, as ingest finds it."""
    values = run.channel("AccX")
    middle = np.median(values)
    top = TOP * np.abs(values - middle).max()
    found = Finding("clipping", "AccX", run.name, f"{run.name}: AccX: at the end of its range")
    cut = memory.with_values(run, "AccX", middle + np.clip(values - middle, -top, top))
    return replace(cut, findings=(*run.findings, found))


def along_x(balanced, unbalanced):
    """The reduction along x of the base accelerometer."""
    named = (
        replace(balanced, path=balanced.path.with_name("with.h5")),
        replace(unbalanced, path=unbalanced.path.with_name("without.h5")),
    )
    (found,) = [r for r in analyze(named, Measure()).reductions if (r.sensor, r.axis) == ("base_acc", "x")]
    return found


def test_neither_clipped(runs):
    """Nothing is a bound: the interval is closed on both sides."""
    whole = along_x(*runs)
    assert whole.limit is None
    assert whole.interval[0] < whole.percent < whole.interval[1] < 100.0


def test_clipped_without_counter_masses(runs):
    """What was there is more than was read, so the reduction is at least what is read; the upper end is open."""
    whole, found = along_x(*runs), along_x(runs[0], clipped(runs[1]))
    assert found.limit == "at_least"
    assert found.percent < whole.percent
    assert found.interval[0] < whole.percent
    assert found.interval[1] == 100.0
    assert document(found)["at_least_percent"] == found.interval[0]


def test_clipped_with_counter_masses(runs):
    """What is left is more than was read, so the reduction is at most what is read: no lower end, no interval."""
    whole, found = along_x(*runs), along_x(clipped(runs[0]), runs[1])
    assert found.limit == "at_most"
    assert found.percent > whole.percent
    assert found.interval is None
    assert document(found)["limit"] == "at_most"
    assert document(found)["at_least_percent"] is None


def test_clipped_on_both_sides(runs):
    """Both amplitudes are bounds: nothing bounds their ratio."""
    found = along_x(clipped(runs[0]), clipped(runs[1]))
    assert found.limit is None
    assert found.interval is None
