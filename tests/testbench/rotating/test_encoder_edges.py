"""Numbering edges: what is lost, too many, out of order or not an edge log at all is named."""

import numpy as np
import pytest

from testbench.errors import AnalysisError, RecordingError
from testbench.rotating import Disc, LostEdges, number_edges, periodic_turn, read_edge_times
from testbench.rotating.encoder_edges import repetition, require_stated_turn
from testbench.rotating.speed_results import speed_findings

from . import discs


def without(time, *lost):
    """A log without some of its edges."""
    return np.delete(time, lost)


@pytest.mark.parametrize("lost", [(57,), (57, 58), (57, 58, 59), (300, 420), (300, 302), (1,), (799,)])
def test_lost_edges_are_counted_where_they_are(lost):
    """One, several in a row, near each other, next to the ends."""
    with pytest.raises(LostEdges, match=r"edges? lost") as caught:
        number_edges("log", without(discs.turning(), *lost), Disc(100))
    gaps = caught.value.gaps
    assert sum(gap.missing for gap in gaps) == len(lost)
    numbers = number_edges("log", without(discs.turning(), *lost), Disc(100), bridge=True).pulse
    np.testing.assert_array_equal(numbers, np.delete(np.arange(801), lost))


def test_lines_missing_from_the_disc_are_named_once():
    """Lines 30 and 31 filled with dirt, and two edges lost, one beside them: no wide slot, not sixteen edges lost."""
    worn = np.add.outer(100 * np.arange(8), [30, 31]).ravel()
    time = without(discs.turning(), *worn, 332, 450)
    with pytest.raises(
        LostEdges, match=r"2 edges lost: 1 after edge 323.*lines 30, 31 of the disc are missing in each"
    ):
        number_edges("log", time, Disc(100))
    log = number_edges("log", time, Disc(100), bridge=True)
    np.testing.assert_array_equal(log.pulse, np.delete(np.arange(801), [*worn, 332, 450]))
    assert (log.worn, [gap.missing for gap in log.gaps]) == ((30, 31), [1, 1])
    assert sum("missing in each turn" in text for text in speed_findings(log, None)) == 1


def test_a_wide_slot_is_no_loss():
    """A slot half a pitch out of place comes again after a turn of the disc: kept as it is."""
    ahead = np.zeros(100)
    ahead[40] = -0.55 * 2 * np.pi / 100
    assert number_edges("log", discs.turning(ahead=ahead), Disc(100)).gaps == ()


@pytest.mark.parametrize("jitter", [0.0, 3e-5])
def test_whole_logs_have_no_gaps(jitter):
    """Jitter, a start from standstill, a disc 10 % out of pitch: nothing is called lost."""
    for time in (discs.turning(jitter=jitter), discs.starting(), discs.turning(ahead=discs.errors(100, 0.1, 2))):
        assert number_edges("log", time, Disc(100)).gaps == ()


def test_a_bridged_log_gives_the_same_answer():
    """The lost edges counted, the turn is the one of the whole log."""
    time = discs.turning()
    whole = periodic_turn(number_edges("log", time, Disc(100))).fluctuation().value
    bridged = periodic_turn(number_edges("log", without(time, 57, 58, 400), Disc(100), bridge=True))
    assert bridged.fluctuation().value == pytest.approx(whole, abs=3e-6)


def test_disorder_is_named():
    """Time that falls, a counter that overflowed, edges too many, too few."""
    time = discs.turning()
    swapped = time.copy()
    swapped[[70, 71]] = swapped[[71, 70]]
    with pytest.raises(RecordingError, match="at edge 71; expected increasing"):
        number_edges("log", swapped, Disc(100))
    with pytest.raises(RecordingError, match="overflowed"):
        number_edges("log", np.mod(time + 4290.0, 2**32 * 1e-6), Disc(100))
    with pytest.raises(RecordingError, match="1 edge too many"):
        number_edges("log", np.sort(np.append(time, time[90] + 1e-4)), Disc(100))
    with pytest.raises(RecordingError, match="at least 8"):
        number_edges("log", time[:5], Disc(100))


def test_the_clock_s_step_is_found():
    """4 us, and none where time is finer than a nanosecond."""
    assert number_edges("log", discs.turning(), Disc(100)).clock_step == pytest.approx(4e-6)
    assert number_edges("log", discs.turning(clock=0.0), Disc(100)).clock_step is None


TABLES = {
    "t_us\n0\n8864\n17720\n": None,
    "t (s)\n0.0\n0.008864\n0.01772\n": None,
    "t\n0\n8864\n17720\n": "no unit of time",
    "t_us,x\n0,1\n8864,2\n17720,3\n": "2 channels",
    "t_us\n0\n8864\nnan\n17720\n": "no number",
}


@pytest.mark.parametrize(("text", "message"), TABLES.items(), ids=["us", "s", "no unit", "two columns", "a hole"])
def test_tables_of_edges(tmp_path, text, message):
    """One column of instants with its unit; anything else is refused by name."""
    path = tmp_path / "edges.csv"
    path.write_text(text, encoding="utf-8")
    if message is None:
        np.testing.assert_allclose(read_edge_times(path), [0.0, 0.008864, 0.01772], rtol=1e-12)
    else:
        with pytest.raises(RecordingError, match=message):
            read_edge_times(path)


def test_a_clock_too_coarse_to_tell_lost_edges_is_named():
    """Intervals of 2.5 ms on a clock of 1 ms: refused for that, not for edges that nobody lost; 0.8 ms pass."""
    time = 2.5e-3 * np.arange(1500) + 1e-4 * np.sin(2 * np.pi * np.arange(1500) / 100)
    with pytest.raises(
        RecordingError, match=r"step of 1000 us is \d+ % of an interval.*lost edges cannot be distinguished"
    ):
        number_edges("log", np.round(time / 1e-3) * 1e-3, Disc(100))
    assert number_edges("log", np.round(time / 0.8e-3) * 0.8e-3, Disc(100)).gaps == ()
    with pytest.raises(LostEdges, match="1 edge lost"):
        number_edges("log", np.delete(8e-3 * np.arange(900), 400), Disc(100))


@pytest.mark.parametrize("stated", [50, 90, 99, 101, 120])
@pytest.mark.parametrize("noise", [{}, {"jitter": 2e-5}, {"jitter": 1e-5, "ahead": discs.errors(100, 0.03)}])
def test_a_wrong_number_is_named_with_the_right_one(stated, noise):
    """A disc of 100 said to have another number: the motion repeats every 100 edges."""
    log = number_edges("log", discs.turning(turns=12, **noise), Disc(stated))
    with pytest.raises(RecordingError, match=f"repeats every 100 edges, not every {stated}"):
        periodic_turn(log)


@pytest.mark.parametrize(("turns", "times"), [(4, 2), (8, 2), (8, 3), (8, 4), (12, 3), (12, 5)])
def test_multiples_of_the_number_are_a_finding(turns, times):
    """A motion that repeats some times a turn may be true: said with the number, not refused, also of a short log."""
    log = number_edges("log", discs.turning(turns=turns), Disc(100 * times))
    (text,) = speed_findings(log, periodic_turn(log))
    assert f"repeats every 100 edges already, {times} times a turn" in text
    assert f"has 100 edges a turn, not {100 * times}" in text


@pytest.mark.parametrize("stated", [20, 25, 50])
def test_parts_of_the_number_are_refused_with_the_right_one(stated):
    """A half, a fourth, a fifth of the edges that the disc has."""
    log = number_edges("log", discs.turning(turns=8), Disc(stated))
    with pytest.raises(RecordingError, match=f"repeats every 100 edges, not every {stated}"):
        periodic_turn(log)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("lines", "shown"), [(2, None), (3, None), (4, 4), (5, 5), (6, 6), (7, 7), (12, 12)])
def test_of_a_disc_of_few_lines_no_multiple_is_named(lines, shown, seed):
    """From four lines on the log shows their number; of fewer it shows none, and refuses none that is right."""
    log = discs.turning(pulses=lines, turns=60, jitter=2e-5, seed=seed)
    right, twice = (number_edges("log", log, Disc(pulses)) for pulses in (lines, 2 * lines))
    require_stated_turn(right)
    assert repetition(right) == shown
    assert repetition(twice) == shown
    said = " ".join(speed_findings(twice, periodic_turn(twice)))
    assert ("check --pulses" in said) == (shown is not None)
    assert ("4 edges a turn do not show harmonic 2 of the turn" in said) == (lines == 2)


def test_the_right_number_is_shown_by_the_log_itself():
    """Also across lost edges; behind a gearbox, where the disc is said to have twice its edges."""
    time = discs.turning(turns=8)
    log = number_edges("log", time, Disc(100))
    assert repetition(log) == 100
    assert speed_findings(log, periodic_turn(log)) == []
    assert repetition(number_edges("log", np.delete(time, [500, 640]), Disc(100), bridge=True)) == 100
    motor = [number_edges("log", discs.turning(ratio=3.61, turns=8), Disc(pulses, 3.61)) for pulses in (100, 200)]
    assert [repetition(log) for log in motor] == [361, 361]
    assert "200" in speed_findings(motor[1], periodic_turn(motor[1]))[-1]


def test_logs_in_which_nothing_repeats_are_let_pass():
    """Constant speed, a start, a disc on another shaft: no number of edges is better than the stated."""
    for log in (np.arange(801) * 7.7731e-3, discs.starting(turns=7)):
        assert periodic_turn(number_edges("log", log, Disc(100))).turns >= 2
    assert repetition(number_edges("log", np.arange(801) * 7.7731e-3, Disc(100))) is None
    motor = number_edges("log", discs.turning(ratio=3.61, turns=8), Disc(100, 3.61))
    assert periodic_turn(motor).turns == 8
    with pytest.raises(AnalysisError, match="no two turns"):
        periodic_turn(number_edges("log", np.cumsum(1e-3 * 0.999 ** np.arange(500)), Disc(100)))


def test_a_speed_that_wanders_is_of_the_turns_that_are_steady():
    """A log that is steady in less than half of its turns says so, with its mean over all."""
    turns, lines = 12, 100
    share = np.arange(turns * lines + 1) / (turns * lines)
    time = turns * 2.0 * np.pi / 100.0 * (share + 0.05 * np.sin(2.0 * np.pi * share) / (2.0 * np.pi))
    log = number_edges("log", time, Disc(lines))
    turn = periodic_turn(log, steady_within=2e-2)
    assert turn.unsteady_turns > turn.turns
    (text,) = speed_findings(log, turn)
    assert text.startswith(f"{turn.turns} of 12 turns are used")
    assert f"whole log is {100.0 * 30.0 / np.pi:.3f} rpm" in text
