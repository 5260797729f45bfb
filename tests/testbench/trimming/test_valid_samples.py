"""What gaps leave of a record: stretches smoothed apart, equations that hold up to their ends, runs left out."""

from dataclasses import replace

import numpy as np
import pytest

from balance.balancing import conditions
from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench.errors import AnalysisError
from testbench.kinematics.gaps import Gaps, ValidSamples
from testbench.kinematics.smoothing_and_derivatives import Grid
from testbench.trimming.problem import TrimProblem
from testbench.trimming.trial_mass_runs import without_gaps

GRID = Grid(0.0, 1e-3, 2000)


@pytest.fixture
def valid():
    """A record of two seconds that lacks a tenth."""
    return ValidSamples("r", GRID, Gaps.of({"encoders": np.r_[GRID.time[:800], GRID.time[900:]]}), 0.025)


def test_what_a_gap_touches_is_zero(valid):
    """From 0.799 to 0.9 s and 25 ms about it; all else is kept."""
    left = np.flatnonzero(valid.kept == 0.0)
    assert (left[0], left[-1]) == (775, 924)
    smooth = valid.low_pass(np.ones((2000, 3)), 40.0)
    assert np.allclose(smooth, valid.kept[:, None])


def test_what_is_proportional_stays_so_up_to_the_gap(valid):
    """Of two signals of which one is three times the other, whatever they are in the gap, both smoothed alike."""
    rng = np.random.default_rng(0)
    one = np.cumsum(rng.normal(size=(2000, 1)), axis=0)
    other = 3.0 * one
    other[800:900] += 100.0
    assert np.abs(valid.low_pass(other, 20.0) - 3.0 * valid.low_pass(one, 20.0)).max() < 1e-9
    assert np.abs(valid.rates(other) - 3.0 * valid.rates(one))[valid.kept > 0.0].max() < 1e-6


def test_without_a_gap_nothing_changes():
    """All is kept, and there is no finding."""
    whole = ValidSamples("r", GRID, Gaps.of({"encoders": GRID.time}), 0.025)
    assert whole.kept.all()
    assert not whole.findings


def test_trials_leave_a_run_with_a_gap_out():
    """By name; where no run is whole, they refuse."""
    runs = [memory.scene("x").run(k) for k in range(2)]
    cut = memory.without(runs[0], "controller", 0.4, 0.5)
    model = load_mechanism(memory.MANIPULATOR)
    case = TrimProblem(memory.aligned([cut, runs[1]], model), conditions.balance_conditions(model), [], None)
    kept, findings = without_gaps(case)
    assert [run.run.recorded for run in kept.runs] == [runs[1]]
    assert "1 gap in the record of controller, 0.101 s in all" in findings[0].message
    assert "the run is left out, for the base rings on through a gap" in findings[0].message
    with pytest.raises(AnalysisError, match="no run can tell:"):
        without_gaps(replace(case, runs=case.runs[:1]))
