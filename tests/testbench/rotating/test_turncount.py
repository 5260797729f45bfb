"""Edges per turn that are not those of the disc."""

import numpy as np
import pytest

from testbench.errors import AnalysisError, RecordingError
from testbench.rotating import Disc, edges_of, periodic_turn
from testbench.rotating.encoder_edges import repetition
from testbench.rotating.speed_results import speed_findings

from . import discs


@pytest.mark.parametrize("stated", [50, 90, 99, 101, 120])
@pytest.mark.parametrize("noise", [{}, {"jitter": 2e-5}, {"jitter": 1e-5, "ahead": discs.errors(100, 0.03)}])
def test_a_wrong_number_is_named_with_the_right_one(stated, noise):
    """A disc of 100 said to have another number: the motion repeats every 100 edges."""
    log = edges_of("log", discs.turning(turns=12, **noise), Disc(stated))
    with pytest.raises(RecordingError, match=f"repeats every 100 edges, not every {stated}"):
        periodic_turn(log)


@pytest.mark.parametrize(("turns", "times"), [(4, 2), (8, 2), (8, 3), (8, 4), (12, 3), (12, 5)])
def test_multiples_of_the_number_are_a_finding(turns, times):
    """A motion that repeats some times a turn may be true: said with the number, not refused, also of a short log."""
    log = edges_of("log", discs.turning(turns=turns), Disc(100 * times))
    (text,) = speed_findings(log, periodic_turn(log))
    assert f"repeats every 100 edges already, {times} times a turn" in text
    assert f"has 100 edges a turn, not {100 * times}" in text


@pytest.mark.parametrize("stated", [20, 25, 50])
def test_parts_of_the_number_are_refused_with_the_right_one(stated):
    """A half, a fourth, a fifth of the edges that the disc has."""
    log = edges_of("log", discs.turning(turns=8), Disc(stated))
    with pytest.raises(RecordingError, match=f"repeats every 100 edges, not every {stated}"):
        periodic_turn(log)


def test_the_right_number_is_shown_by_the_log_itself():
    """Also across lost edges; behind a gearbox, where the disc is said to have twice its edges."""
    time = discs.turning(turns=8)
    log = edges_of("log", time, Disc(100))
    assert repetition(log) == 100
    assert speed_findings(log, periodic_turn(log)) == []
    assert repetition(edges_of("log", np.delete(time, [500, 640]), Disc(100), bridge=True)) == 100
    motor = [edges_of("log", discs.turning(ratio=3.61, turns=8), Disc(pulses, 3.61)) for pulses in (100, 200)]
    assert [repetition(log) for log in motor] == [361, 361]
    assert "200" in speed_findings(motor[1], periodic_turn(motor[1]))[-1]


def test_logs_in_which_nothing_repeats_are_let_pass():
    """Constant speed, a start, a disc on another shaft: no number of edges is better than the stated."""
    for log in (np.arange(801) * 7.7731e-3, discs.starting(turns=7)):
        assert periodic_turn(edges_of("log", log, Disc(100))).turns >= 2
    assert repetition(edges_of("log", np.arange(801) * 7.7731e-3, Disc(100))) is None
    motor = edges_of("log", discs.turning(ratio=3.61, turns=8), Disc(100, 3.61))
    assert periodic_turn(motor).turns == 8
    with pytest.raises(AnalysisError, match="no two turns"):
        periodic_turn(edges_of("log", np.cumsum(1e-3 * 0.999 ** np.arange(500)), Disc(100)))
