"""The cut-off and the delay follow the held-out torque error and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from balance.estimation.identifiability import identifiability
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.identification.cross_validation import (
    CUTOFFS_HZ,
    CrossValidation,
    choose,
    delays,
    possible_cutoffs,
    unexplained,
)
from testbench.identification.regression_equations import regression_equations

from . import arms

ARM = load_mechanism("two-joint-arm-a0")


def test_chosen_is_the_least_of_all():
    """The chosen candidate has the least error of the best ones of each cut-off."""
    record = arms.record(ARM, seed=5)
    evidence = regression_equations([record], ARM, 5.0)
    choice = choose([record], ARM, identifiability(evidence.columns, evidence.names))
    assert choice.chosen.error == min(one.error for one in choice.best_of_each)
    assert [one.cutoff for one in choice.best_of_each] == possible_cutoffs([record])


def test_a_stretch_is_predicted_from_the_others():
    """Torque changed in the middle of a stretch changes what predicts the other folds, not what predicts its own."""
    record = arms.record(ARM, seed=6)
    torque = record.torque.copy()
    evidence = regression_equations([record], ARM, 5.0)
    seen = identifiability(evidence.columns, evidence.names)
    before = CrossValidation(evidence, ARM, seen)
    stretch = slice(425, 445)  # the middle of the fourth of ten stretches
    torque[stretch] += 50.0
    after = CrossValidation(regression_equations([replace(record, torque=torque)], ARM, 5.0), ARM, seen)
    changed = np.abs(after.parameters(0.0) - before.parameters(0.0)).max(axis=1)
    own = before.fold[435 - 50]
    assert changed[own] < 0.05 * np.delete(changed, own).min()


def test_cutoffs_fit_the_record():
    """Candidates are those of the list for which the record is long and dense enough, with room to double."""
    found = possible_cutoffs([arms.record(ARM)])
    assert set(found) < set(CUTOFFS_HZ)
    assert min(found) * arms.SECONDS >= 10.0
    assert 4 * max(found) <= 0.4 * arms.RATE


def test_delays_are_whole_samples():
    """Delays are whole samples of up to 20 ms either way."""
    assert delays([arms.record(ARM)]) == pytest.approx([k / arms.RATE for k in range(-4, 5)])
    assert delays([arms.record(ARM, rate=1000.0)]) == pytest.approx([2e-3 * k for k in range(-10, 11)])


def test_unexplained():
    """Nothing left is 0, nothing predicted is 1; samples that are not used do not count."""
    torque = np.array([[3.0], [4.0], [100.0]])
    used = np.array([[1.0], [1.0], [0.0]])
    assert unexplained(torque, torque, used) == 0.0
    assert unexplained(torque, 0 * torque, used) == 1.0
    assert unexplained(torque, torque - [[0.3], [0.4], [7.0]], used) == pytest.approx(0.1)
