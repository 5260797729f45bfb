"""Times in few digits against lost samples: columns of known rate, and of known loss."""

import json
import re
import sys

import numpy as np
import pytest

from testbench.cli import main
from testbench.quality.time_steps import LENGTH, StepReservoir
from testbench.recording import TimeColumn

from .test_time_steps import checked

MS = TimeColumn(0, 1e-3)
"""A column in milliseconds."""


def rounded(rate, decimals, count=20_000, first=0.0, way=np.round):
    """Times [s] of a steady clock, written with so many decimals."""
    return way((first + np.arange(count) / rate) * 10**decimals) / 10**decimals


def lossy(share, count=20_000, seed=1):
    """Times [ms] of a clock of 1 kHz of which a share was lost by chance, and how many gaps that makes."""
    kept = np.arange(float(count))[np.random.default_rng(seed).random(count) >= share]
    return kept, int((np.diff(kept) > 1.5).sum())


@pytest.mark.parametrize("first", [0.0, 86_400.123])
@pytest.mark.parametrize("way", [np.round, np.floor])
@pytest.mark.parametrize(
    ("rate", "decimals"),
    [
        *((rate, 3) for rate in (950, 900, 833, 800, 750, 700, 2000 / 3, 600, 550, 501, 450, 400, 350, 300, 260, 120)),
        *((rate, 4) for rate in (833, 1200, 1900, 4000, 7777, 9500)),
        *((rate, 6) for rate in (51_200, 400_000, 700_000)),
        (0.7, 0),
    ],
)
def test_the_rate_is_that_of_the_mean(rate, decimals, way, first):
    """To one place over the length of the log, whichever way it was rounded; nothing is called a gap or jitter."""
    column = rounded(rate, decimals, first=first, way=way)
    group, findings = checked(column)
    assert group.rate_hz == pytest.approx(rate, rel=1.1 * 10.0**-decimals / (column[-1] - column[0]))
    assert group.rate_source == "mean_step"
    assert not findings.keys() & {"time_gap", "time_irregular"}
    (said,) = findings.keys() & {"rate_rounded", "rate_doubtful"}
    assert f"{group.rate_hz:.6g} Hz by their mean" in findings[said].message


def test_any_rate_in_whole_milliseconds():
    """Rates drawn from 60 to 950 Hz: the mean, but for those whose step is a whole number of milliseconds."""
    for rate in np.random.default_rng(6).uniform(60.0, 950.0, 60):
        column = np.round(np.arange(5000) * 1e3 / rate)
        group, _ = checked(column, column=MS)
        assert group.rate_hz == pytest.approx(rate, rel=1.1 / column[-1])


@pytest.mark.parametrize("rate", [494.7, 251.9, 133.2583])
def test_a_clock_that_trembles_a_little(rate):
    """Times that scatter by 0.03 places before they are rounded take a third number of places now and then."""
    times = np.arange(6000) * 1e3 / rate
    column = np.round(times + np.random.default_rng(9).normal(0.0, 0.03, 6000))
    group, findings = checked(column, column=MS)
    assert group.rate_hz == pytest.approx(rate, rel=2.0 / column[-1])
    assert "time_gap" not in findings
    assert "time_gap" not in checked(np.floor(times), column=MS)[1]


def test_logs_of_one_clock_that_trembles_have_one_rate():
    """Times of 1 kHz that scatter by a twentieth of a step: from the first to the last sample, not by the median."""
    for seed in range(3):
        column = np.round(np.arange(2000) + np.random.default_rng(seed).uniform(-0.05, 0.05, 2000), 3)
        group, findings = checked(column, column=MS)
        assert group.rate_hz == pytest.approx(1000.0, rel=0.1 / column[-1])
        assert findings.keys() & {"time_jitter", "rate_rounded", "rate_doubtful"} == {"time_jitter"}


def test_a_short_log():
    """A second of it is enough; a dozen samples are not, and have the answer of the median or none."""
    assert checked(rounded(700, 3, 700))[0].rate_hz == pytest.approx(700, rel=2e-3)
    assert checked(rounded(700, 3, 12))[0].rate_source != "mean_step"
    group, findings = checked(rounded(900, 3, 60))
    assert (group.rate_source, "or times in too few digits" in findings["time_gap"].message) == ("median_step", True)


def test_doubt_only_where_it_may_be_loss():
    """Steps of one and two places, the longer ones rarer: 700 Hz may be 1 kHz that lost three in ten; 600 Hz, 400 Hz
    and 833 Hz in tenths cannot."""
    _, findings = checked(np.round(np.arange(20_000) * 1e3 / 700), column=MS)
    message = findings["rate_doubtful"].message
    assert re.search(r"the rate is 700 Hz .* logger of 1000 Hz that lost one sample in 3\.33 as evenly", message)
    for rate, decimals in ((600, 3), (400, 3), (833, 4)):
        assert "rate_doubtful" not in checked(rounded(rate, decimals))[1]


@pytest.mark.parametrize("share", [0.0005, 0.003, 0.02, 0.06, 0.12, 0.18])
@pytest.mark.parametrize("seed", range(4))
def test_lost_samples_stay_gaps(share, seed):
    """A clock of 1 kHz that lost samples by chance is one of 1 kHz, and every gap is counted."""
    column, gaps = lossy(share, seed=seed)
    group, findings = checked(column, column=MS)
    assert (group.rate_hz, group.rate_source) == (1000.0, "median_step")
    assert f": {gaps} (" in findings["time_gap"].message
    assert "rate_doubtful" not in findings
    uneven = "samples lost all over: they do not come as evenly as rounding"
    assert (uneven in findings["time_gap"].message) == (share > 0.055)
    assert "cannot be told" not in findings["time_gap"].message


def test_loss_that_is_even_for_a_while():
    """Every eighth sample for a third of the log, then as many by chance: all of them are lost samples."""
    kept = np.random.default_rng(4).random(30_000) >= 0.15
    kept[:10_000] = np.arange(10_000) % 8 != 7
    group, findings = checked(np.flatnonzero(kept).astype(float), column=MS)
    assert (group.rate_hz, "rate_doubtful" in findings) == (1000.0, False)
    assert "samples lost all over" in findings["time_gap"].message


@pytest.mark.parametrize("share", [0.3, 0.45])
def test_more_loss_than_a_rate_can_be_told_from(share):
    """No rate is made of the mean of what is left."""
    column, _ = lossy(share)
    group, findings = checked(column, column=MS)
    assert (group.rate_hz, "time_irregular" in findings) == (None, True)


@pytest.mark.parametrize(("every", "count"), [(100, 20_000), (30, 300_000), (25, 2000)])
def test_what_cannot_be_told_is_said_and_the_median_kept(every, count):
    """One sample in many lost as evenly as rounding would make it, such as at the end of each buffer."""
    column = np.arange(float(count))[np.arange(count) % every != every - 1]
    group, findings = checked(column, column=MS)
    assert (group.rate_hz, "rate_doubtful" in findings) == (1000.0, False)
    lost_or_rounded = rf"cannot be told.*|a sample takes {every / (every - 1):.4g}"
    assert re.search(lost_or_rounded, findings["time_gap"].message)
    assert f"{len(np.flatnonzero(np.diff(column) > 1))} (" in findings["time_gap"].message


def test_few_gaps_are_no_matter_of_doubt():
    """Three lost samples are three gaps, and nothing else is said."""
    column = np.delete(np.arange(5000.0), [1000, 2000, 3000])
    group, findings = checked(column, column=MS)
    assert group.rate_hz == 1000.0
    assert "cannot be told" not in findings["time_gap"].message


@pytest.mark.parametrize(
    ("stated", "every", "rate"), [(1000.0, 10, 1000.0), (900.0, 10, 900.0), (None, 10, 900.0), (990.0, 100, 990.0)]
)
def test_the_rate_of_the_header_tells(stated, every, rate):
    """The same times, read as rounded or as lost samples by what the header states; then there is no doubt."""
    column = np.arange(20_000.0)[np.arange(20_000) % every != every - 1]
    group, findings = checked(column, column=MS, stated=stated)
    assert group.rate_hz == pytest.approx(rate, rel=1e-4)
    assert ("time_gap" in findings) == (rate == 1000.0)
    assert ("rate_doubtful" in findings) == (stated is None)
    assert ("so many are samples lost all over" in str(findings.get("time_gap"))) == (rate == 1000.0)
    assert "rate_contradiction" not in findings


@pytest.mark.parametrize("rate", [833, 700, 450])
def test_samples_lost_besides(rate):
    """Rounded times with a pause and single losses: the rate is right, the pause is a gap, and the losses are said."""
    random = np.random.default_rng(2)
    kept = np.delete(np.arange(40_000), random.choice(np.arange(5000, 30_000), 20, replace=False))
    column = np.round(kept[(kept < 33_000) | (kept > 36_000)] * 1e3 / rate)
    group, findings = checked(column, column=MS)
    assert group.rate_hz == pytest.approx(rate, rel=5e-4)
    steps = np.diff(column)
    assert f": {int((steps > np.floor(1e3 / rate) + 1.5).sum())} (" in findings["time_gap"].message
    hidden = rate > 500  # a lost sample may make a step of two places, as rounding does; above two places it cannot
    assert ("samples may be lost there" in findings["time_gap"].message) == hidden


def test_steps_of_no_steady_clock():
    """Whole milliseconds drawn at random, from one or two, or from two or three, have no rate."""
    for low in (1, 2):
        column = np.cumsum(np.random.default_rng(8).integers(low, low + 2, 20_000)).astype(float)
        group, findings = checked(column, column=MS)
        assert (group.rate_hz, "time_irregular" in findings) == (None, True)


def test_the_answer_does_not_depend_on_blocks():
    """Rate and findings are those of the whole column, however it is cut."""
    column = np.round(np.arange(30_000) * 1e3 / 700)
    answers = {checked(column, block, column=MS)[0].rate_hz for block in (977, LENGTH, 10**6)}
    assert len(answers) == 1


@pytest.mark.parametrize("block", [1000, LENGTH, 50_021])
def test_stretches_in_bounded_memory(block):
    """They are rows of the column, spread over it, whatever the blocks; no more than sixteen."""
    steps = np.arange(300_000.0)
    kept = StepReservoir()
    for start in range(0, len(steps), block):
        kept.add(steps[start : start + block])
    rows = kept.in_a_row()
    assert 8 <= len(rows) <= 16
    assert all((np.diff(row) == 1.0).all() and len(row) <= LENGTH for row in rows)
    starts = [row[0] for row in rows]
    assert set(np.diff(starts)) == {8.0 * LENGTH}
    assert (starts[0], rows[-1][-1] > 0.85 * len(steps)) == (0.0, True)


@pytest.mark.parametrize(
    ("rate", "decimals", "header", "code", "expected"),
    [
        (833, 0, "", 3, {"rate_doubtful"}),
        (833, 0, "# rate: 833 Hz\n", 0, set()),
        (833, 1, "", 0, {"rate_rounded"}),
        (400, 0, "", 0, {"rate_rounded"}),
        (1000, 0, "", 0, set()),
    ],
)
def test_the_command(tmp_path, monkeypatch, capsys, rate, decimals, header, code, expected):
    """A log in milliseconds, described and ingested as typed: rate, its source, findings and exit code."""
    rows = "".join(f"{k * 1e3 / rate:.{decimals}f},{np.sin(k / 9):.4f}\n" for k in range(5000))
    (tmp_path / "log.csv").write_text(f"{header}Time (ms),AccX (g)\n{rows}")
    monkeypatch.chdir(tmp_path)
    for words in (["info", "log.csv", "--stats"], ["ingest", "log.csv", "-o", "c"], ["list", "c"]):
        monkeypatch.setattr(sys, "argv", ["testbench", *words, "--json"])
        with pytest.raises(SystemExit) as stop:
            main()
        text = capsys.readouterr().out
        assert stop.value.code == (0 if words[0] == "list" else code)
        assert set(re.findall(r'"code": "(time_\w+|rate_\w+)"', text)) == expected
    (group,) = json.loads(text)["runs"][0]["groups"]
    assert group["rate_hz"] == pytest.approx(rate, rel=3e-4)
    assert group["rate_source"] == ("median_step" if rate == 1000 else "mean_step")


def test_gaps_are_listed_as_they_come():
    """The longest of them, of equal ones the first, each in the order of the record."""
    times = np.delete(np.arange(5000.0), np.r_[1000:4000:100, 1500:1503, 2500:2502])
    message = checked(times, column=MS)[1]["time_gap"].message
    listed = [(int(step), int(line)) for step, line in re.findall(r"(\d) s before line (\d+)", message)]
    assert "30 (the longest: 2 s before line 1002, " in message
    assert [step for step, _ in listed] == [2, 2, 2, 2, 2, 4, 2, 2, 2, 3]
    assert [line for _, line in listed] == sorted(line for _, line in listed)
