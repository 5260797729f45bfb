"""Edges per turn that are not those of the disc."""

import numpy as np
import pytest

from testbench.encoder import Disc, edges_of, periodic_turn
from testbench.encoder.document import findings
from testbench.errors import AnalysisError, RecordingError

from . import discs


@pytest.mark.parametrize("stated", [50, 90, 99, 101, 120])
@pytest.mark.parametrize("noise", [{}, {"jitter": 2e-5}, {"jitter": 1e-5, "ahead": discs.errors(100, 0.03)}])
def test_a_wrong_number_is_named_with_the_right_one(stated, noise):
    """A disc of 100 said to have another number: the motion repeats every 100 edges."""
    log = edges_of("log", discs.turning(turns=12, **noise), Disc(stated))
    with pytest.raises(RecordingError, match=f"repeats every 100 edges, not every {stated}"):
        periodic_turn(log)


def test_twice_the_number_is_a_finding():
    """A motion that repeats twice a turn may be true: said, not refused; none with the right number."""
    time = discs.turning(turns=12)
    double, right = (edges_of("log", time, Disc(pulses)) for pulses in (200, 100))
    assert any("repeats every 100 edges already, 2 times" in text for text in findings(double, periodic_turn(double)))
    assert not any("already" in text for text in findings(right, periodic_turn(right)))


def test_logs_in_which_nothing_repeats_are_let_pass():
    """Constant speed, a start, a disc on another shaft: no number of edges is better than the stated."""
    for log in (np.arange(801) * 7.7731e-3, discs.starting(turns=7)):
        assert periodic_turn(edges_of("log", log, Disc(100))).turns >= 2
    motor = edges_of("log", discs.turning(ratio=3.61, turns=8), Disc(100, 3.61))
    assert periodic_turn(motor).turns == 8
    with pytest.raises(AnalysisError, match="no two turns"):
        periodic_turn(edges_of("log", np.cumsum(1e-3 * 0.999 ** np.arange(500)), Disc(100)))
