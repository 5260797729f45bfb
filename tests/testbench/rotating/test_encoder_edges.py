"""Numbering edges: what is lost, too many, out of order or not an edge log at all is named."""

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.rotating import Disc, LostEdges, edges_of, periodic_turn, read_times

from . import discs


def without(time, *lost):
    """A log without some of its edges."""
    return np.delete(time, lost)


@pytest.mark.parametrize("lost", [(57,), (57, 58), (57, 58, 59), (300, 420), (300, 302), (1,), (799,)])
def test_lost_edges_are_counted_where_they_are(lost):
    """One, several in a row, near each other, next to the ends."""
    with pytest.raises(LostEdges, match=r"edges? lost") as caught:
        edges_of("log", without(discs.turning(), *lost), Disc(100))
    gaps = caught.value.gaps
    assert sum(gap.missing for gap in gaps) == len(lost)
    numbers = edges_of("log", without(discs.turning(), *lost), Disc(100), bridge=True).pulse
    np.testing.assert_array_equal(numbers, np.delete(np.arange(801), lost))


def test_a_slot_missing_from_the_disc_is_a_loss_every_turn():
    """Slot 30 filled with dirt: eight gaps, not a wide slot."""
    lost = 30 + 100 * np.arange(8)
    with pytest.raises(LostEdges) as caught:
        edges_of("log", without(discs.turning(), *lost), Disc(100))
    assert [gap.missing for gap in caught.value.gaps] == [1] * 8


def test_a_wide_slot_is_no_loss():
    """A slot half a pitch out of place comes again after a turn of the disc: kept as it is."""
    ahead = np.zeros(100)
    ahead[40] = -0.55 * 2 * np.pi / 100
    assert edges_of("log", discs.turning(ahead=ahead), Disc(100)).gaps == ()


@pytest.mark.parametrize("jitter", [0.0, 3e-5])
def test_whole_logs_have_no_gaps(jitter):
    """Jitter, a start from standstill, a disc 10 % out of pitch: nothing is called lost."""
    for time in (discs.turning(jitter=jitter), discs.starting(), discs.turning(ahead=discs.errors(100, 0.1, 2))):
        assert edges_of("log", time, Disc(100)).gaps == ()


def test_a_bridged_log_gives_the_same_answer():
    """The lost edges counted, the turn is the one of the whole log."""
    time = discs.turning()
    whole = periodic_turn(edges_of("log", time, Disc(100))).fluctuation().value
    bridged = periodic_turn(edges_of("log", without(time, 57, 58, 400), Disc(100), bridge=True))
    assert bridged.fluctuation().value == pytest.approx(whole, abs=3e-6)


def test_disorder_is_named():
    """Time that falls, a counter that ran over, edges too many, too few."""
    time = discs.turning()
    swapped = time.copy()
    swapped[[70, 71]] = swapped[[71, 70]]
    with pytest.raises(RecordingError, match="at edge 71; expected increasing"):
        edges_of("log", swapped, Disc(100))
    with pytest.raises(RecordingError, match="ran over"):
        edges_of("log", np.mod(time + 4290.0, 2**32 * 1e-6), Disc(100))
    with pytest.raises(RecordingError, match="1 edge too many"):
        edges_of("log", np.sort(np.append(time, time[90] + 1e-4)), Disc(100))
    with pytest.raises(RecordingError, match="at least 8"):
        edges_of("log", time[:5], Disc(100))


def test_the_clock_s_step_is_found():
    """4 us, and none where time is finer than a nanosecond."""
    assert edges_of("log", discs.turning(), Disc(100)).clock_step == pytest.approx(4e-6)
    assert edges_of("log", discs.turning(clock=0.0), Disc(100)).clock_step is None


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
        np.testing.assert_allclose(read_times(path), [0.0, 0.008864, 0.01772], rtol=1e-12)
    else:
        with pytest.raises(RecordingError, match=message):
            read_times(path)


def test_a_clock_too_coarse_to_tell_lost_edges_is_named():
    """Intervals of 2.5 ms on a clock of 1 ms: refused for that, not for edges that nobody lost; 0.8 ms pass."""
    time = 2.5e-3 * np.arange(1500) + 1e-4 * np.sin(2 * np.pi * np.arange(1500) / 100)
    with pytest.raises(RecordingError, match=r"step of 1000 us is \d+ % of an interval.*lost edges cannot be told"):
        edges_of("log", np.round(time / 1e-3) * 1e-3, Disc(100))
    assert edges_of("log", np.round(time / 0.8e-3) * 0.8e-3, Disc(100)).gaps == ()
    with pytest.raises(LostEdges, match="1 edge lost"):
        edges_of("log", np.delete(8e-3 * np.arange(900), 400), Disc(100))
