"""Several sources of one thing: weighted by what each knows, and whether they agree."""

import numpy as np
import pytest

from balance.balancing import conditions
from balance.estimation.first_moment_imbalance import Imbalance, Subspace, combine
from balance.mechanism.mjcf_parser import load_mechanism


@pytest.fixture(scope="module")
def found():
    """The conditions of an arm of two joints."""
    return conditions.balance_conditions(load_mechanism("serial-2r"))


def source(found, values, errors, free=None, freedom=1000, by_file=None):
    """A source with these values and standard errors, and how it follows errors of the file."""
    rank = found.rank
    free = free or Subspace.all_values(found)
    covariance = np.diag(np.square(errors)) + (0.0 if by_file is None else by_file @ by_file.T)
    return Imbalance(found, np.array(values), covariance, free, np.eye(rank), 0.0, freedom, by_file=by_file)


def test_weights(found):
    """The mean weighted by 1 / variance, and its variance."""
    rank = found.rank
    both = combine([source(found, [1.0] * rank, [0.3] * rank), source(found, [2.0] * rank, [0.6] * rank)]).imbalance
    assert both.values == pytest.approx(1.2)
    assert np.diag(both.covariance) == pytest.approx(1.0 / (1.0 / 0.09 + 1.0 / 0.36))


def test_agreement_is_chi_square(found):
    """Sources that scatter as they say contradict each other as seldom as stated; twice the scatter is noticed."""
    rng = np.random.default_rng(3)
    rank = found.rank
    seen = []
    for scatter in (1.0, 4.0):
        draws = rng.normal(0.0, scatter * 0.1, (400, 2, rank))
        combined = [combine([source(found, one, [0.1] * rank) for one in draw]) for draw in draws]
        assert {one.degrees_of_freedom for one in combined} == {rank}
        seen.append(np.mean([one.probability < 0.05 for one in combined]))
    assert 0.02 < seen[0] < 0.09
    assert seen[1] > 0.7


@pytest.mark.parametrize("by_file", [0.0, 0.05], ids=["not in the interval", "wrong by as much"])
def test_what_a_source_holds_it_does_not_tell(found, by_file):
    """A source that fixed one condition adds nothing there, whatever its value, and whatever it may be wrong by."""
    rank = found.rank
    unit = np.eye(rank)
    free = Subspace(unit[1:], np.zeros(rank))
    errors = np.full(rank, 0.1)
    errors[0] = by_file
    both = combine([source(found, [1.0] * rank, [0.1] * rank), source(found, [0.0] + [1.0] * (rank - 1), errors, free)])
    assert both.imbalance.values == pytest.approx(1.0)
    assert both.imbalance.estimate(unit[0]).standard_uncertainty == pytest.approx(0.1)
    assert both.degrees_of_freedom == rank - 1


@pytest.mark.parametrize("followed", [(0.8, 0.8), (0.8, 0.2), (0.8, None)], ids=["alike", "unlike", "one alone"])
def test_what_sources_take_from_one_file_is_wrong_in_all(found, followed):
    """Known truth: the error of the file stays in the mean and in what is fixed, and does not count as disagreement."""
    rank, rng, noise, wrong = found.rank, np.random.default_rng(5), 0.1, 0.5
    free = Subspace(np.eye(rank)[1:], np.zeros(rank))
    every, whole = np.r_[0.0, np.full(rank - 1, noise)], np.full(rank, noise)
    followers = [None if one is None else np.outer(np.r_[1.0, np.full(rank - 1, one)], np.eye(rank)[0]) * wrong
                 for one in followed]  # fmt: skip
    combined = []
    for _ in range(400):
        error, drawn = rng.normal(size=rank), []
        for per in followers:
            errors = whole if per is None else every
            values = rng.normal(0.0, errors) + (0.0 if per is None else per @ error)
            drawn.append(source(found, values, errors, None if per is None else free, 1e6, per))
        combined.append(combine(drawn))
    one = combined[0].imbalance
    values = np.array([each.imbalance.values - each.imbalance.subspace.start for each in combined])[:, 1:]
    assert np.sqrt(np.diag(one.covariance))[1:] == pytest.approx(values.std(axis=0), rel=0.08)
    assert one.covariance[0, 0] == pytest.approx(noise**2 if None in followed else wrong**2)
    assert 0.02 < np.mean([each.probability < 0.05 for each in combined]) < 0.09
