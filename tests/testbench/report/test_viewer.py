"""The viewer of a campaign: it draws what is stored, peaks kept; what it compares is aligned; who accepted what."""

import re
import shutil
from dataclasses import replace
from statistics import NormalDist
from threading import Thread

import numpy as np
import pytest

from testbench.cross_examination import Examination, Statement, examine
from testbench.cross_examination.statement import accept
from testbench.errors import AnalysisError, StoreError
from testbench.recording import Channel, Group, UniformClock
from testbench.report import traces
from testbench.report.overlay import RunTraces, overlay
from testbench.report.traces import AT_ONCE, BLOCK, Lag, Trace, difference, motion_begins, motion_lag, shown_lag
from testbench.report.viewer import Viewer
from testbench.runs.si_run import SIRun
from testbench.store import open_campaign
from testbench.store.ledger import read_ledger
from testbench.store.writer import RunWriter

from ..conftest import PAIR, call
from .test_campaign_page import HOSTILE

RATE = 1000.0


def trace(values, start=0.0, rate=RATE, name="a"):
    """A trace of values in memory."""
    time = start + np.arange(len(values)) / rate
    return Trace("kind", name, "N", len(values), lambda begin, end: (time[begin:end], values[begin:end]))


def lag(shared, commands, telling, encoders=()):
    """By what tells the motion, else by what the logger shows."""
    return motion_lag(shared, commands, encoders) or shown_lag(shared, telling)


def decoded(channel):
    """Values of a drawn channel, (k,)."""
    low, high = channel.limits
    return np.where(
        channel.values == -32768, np.nan, low + (channel.values.astype(float) + 32767.0) * (high - low) / 65534
    )


@pytest.mark.parametrize("width", [1.0, 0.1, 0.001])
def test_no_peak_is_lost(width):
    """Of ranges of a long record, drawn by blocks or by samples, the extremes are those of its samples."""
    values = np.random.default_rng(1).normal(size=3 * AT_ONCE + 77)
    values[2 * AT_ONCE + 5], values[12345], values[-AT_ONCE] = 40.0, np.nan, np.inf
    found = trace(values)
    first = 0.6 * len(values) / RATE
    last = first + width * 0.4 * len(values) / RATE
    drawn = found.between(first, last, 500)
    inside = values[round(first * RATE) : round(last * RATE)]
    seen = decoded(drawn)
    step = (drawn.limits[1] - drawn.limits[0]) / 65534
    assert np.nanmax(seen) >= inside[np.isfinite(inside)].max() - step
    assert np.nanmin(seen) <= inside.min() + step
    assert len(drawn.values) <= 2 * 500 + 2 * BLOCK
    assert len(found.blocks[1]) == -(-len(values) // BLOCK)


def test_every_sample_where_there_is_room():
    """A short range is drawn sample by sample, at its instants."""
    values = np.random.default_rng(2).normal(size=5000)
    drawn = trace(values, start=3.0).between(4.0, 4.1, 500)
    assert drawn.whole
    assert drawn.start == pytest.approx(3.999)
    np.testing.assert_allclose(decoded(drawn), values[999:1101], atol=1e-4)


def pulse(late, noise, seed, rate=RATE, size=1.0):
    """Rest, a motion that begins ``late`` [s], rest; with white noise."""
    time = np.arange(int(4 * rate)) / rate
    shape = size * np.exp(-(((time - 2.0 - late) / 0.2) ** 2)) * np.sin(2 * np.pi * 7.0 * (time - late))
    return shape + noise * np.random.default_rng(seed).normal(size=len(time))


def held(apart, begin, end, truth=0.0):
    """Which intervals of a difference hold the true one, from one sample to another."""
    values, half = (one.read(begin, end)[1] for one in (apart.trace, apart.half_width))
    return np.abs(values - truth) <= half


@pytest.mark.parametrize(("pole", "within"), [(0.0, 0.02), (0.5, 0.1), (0.9, 0.2)])
def test_degrees_of_freedom_of_noise_at_rest(pole, within):
    """Of noise of one pole n (1 - pole^2) / (1 + pole^2) less that of the mean (Bartlett); the larger the pole, the
    fewer frequencies tell it, and the mean takes some of the lowest off.
    """
    from scipy.signal import lfilter

    values = lfilter([1.0], [1.0, -pole], np.random.default_rng(4).normal(size=(60, 700)))[:, 200:]
    found = [trace(np.append(one, np.zeros(50))).noise(0.5065)[1] for one in values]
    assert np.median(found) == pytest.approx(500 * (1 - pole**2) / (1 + pole**2) - 1.0, rel=within)


@pytest.mark.parametrize("late", [0.0, 0.0123, -0.2])
def test_repeats_differ_by_their_noise(late):
    """Repeats that begin at other times are aligned to far below a sample, and 95 % of intervals of their difference
    hold zero: within 3 %, for 4,000 values, and a lag that is known by noise too.
    """
    pairs = [(trace(pulse(0.0, 0.01, 1), start=5.0), trace(pulse(late, 0.01, 2), start=9.0))]
    found = lag(pairs, [], pairs)
    assert found.seconds == pytest.approx(4.0 + late, abs=0.1 / RATE)
    apart = difference(*pairs[0], found, [motion_begins([one]) for one in pairs[0]])
    assert held(apart, 300, 3600).mean() == pytest.approx(0.95, abs=0.03)


def burst(shift, noise, seed, hertz, size=5.0):
    """A wave of ``hertz`` that swells and fades, on a clock that began ``shift`` [s] later; with white noise."""
    time = np.arange(4000) / RATE + shift
    swell = np.where((time > 1.0) & (time < 3.0), np.sin(np.pi * (time - 1.0) / 2.0) ** 2, 0.0)
    return size * swell * np.sin(2 * np.pi * hertz * time) + noise * np.random.default_rng(seed).normal(size=4000)


@pytest.mark.parametrize("hertz", [40.0, 80.0, 150.0])
def test_clocks_half_a_sample_apart(hertz):
    """What a straight line between two samples leaves of a wave, up to 11 % of one of 150 Hz, is in no difference."""
    pair = trace(burst(0.0, 0.005, 1, hertz)), trace(burst(0.2005, 0.005, 2, hertz))
    found = lag([pair], [], [pair])
    assert found.seconds == pytest.approx(-0.2005, abs=1e-3 / RATE)
    apart = difference(*pair, found, [motion_begins([one]) for one in pair])
    assert held(apart, 1200, 2800).mean() == pytest.approx(0.95, abs=0.03)


@pytest.mark.parametrize(
    ("rest", "hertz", "deviation", "most"), [(0, 25.0, 1e-4, 0.98), (8000, 25.0, 1e-4, 0.98), (0, 50.0, 2e-3, 1.0)]
)
def test_a_lag_counts_where_it_is_steep(rest, hertz, deviation, most):
    """Of one wave on clocks whose lag is wrong by each quantile of its error, 95 % of the intervals hold zero at rest,
    in the steepest fifth of the motion and in the flattest, however many samples rest after it; no fewer where the lag
    is known to 0.6 rad of the wave, more by the noise in what it changes by.
    """
    slope = np.abs(np.gradient(burst(0.0, 0.0, 0, hertz)))[:3000]
    steep, flat = np.quantile(slope[1200:2800], [0.8, 0.2])
    inside = (np.arange(3000) >= 1200) & (np.arange(3000) < 2800)
    places = slope > steep, inside & (slope < flat), np.arange(3000) < 900
    hits = []
    for seed, share in enumerate(np.linspace(0.025, 0.975, 20)):
        pair = [trace(np.r_[burst(0.0, 0.005, 2 * seed + i, hertz), np.zeros(rest)]) for i in (0, 1)]
        apart = difference(*pair, Lag(deviation * NormalDist().inv_cdf(share), deviation, "the encoder"), [1.0, 1.0])
        hits.append([held(apart, 0, 3000)[place].mean() for place in places])
    found = np.mean(hits, axis=0)
    assert (found > 0.92).all()
    assert (found < most).all()


@pytest.mark.parametrize(("unlike", "rest"), [(0.0, 0), (0.03, 0), (0.03, 8000)])
def test_the_deviation_of_a_lag_is_that_of_its_errors(unlike, rest):
    """Of repeats that differ in the motion too, by a share of waves of the same band, however long both rest after it:
    to a quarter: 40 errors tell it to 11 %, and some ten blocks each deviation.
    """
    waves = np.random.default_rng(0)

    def runs(late, hertz, phases, sizes):
        time = np.arange(4000) / RATE - late
        swell = np.where((time > 1.0) & (time < 3.0), np.sin(np.pi * (time - 1.0) / 2.0) ** 2, 0.0)
        return swell * (sizes @ np.sin(2.0 * np.pi * np.outer(hertz, time) + phases[:, None]))

    def drawn():
        return waves.uniform(5.0, 40.0, 30), waves.uniform(0.0, 6.28, 30), waves.normal(size=30)

    shared, ratios = drawn(), []
    for _ in range(40):
        late, both = waves.uniform(-0.002, 0.002), np.zeros((2, 4000 + rest))
        both[:, :4000] = runs(0.0, *shared), runs(late, *shared) + unlike * runs(late, *drawn())
        pair = [trace(one) for one in both + 0.005 * waves.normal(size=both.shape)]
        found = lag([pair], [], [pair])
        ratios.append((found.seconds - late) / found.deviation)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.25)


def moved(begin, end, noise, seed, gain=1.0, zero=0.0, step=5e-5, sizes=(0.8, -1.0, 0.5), lasting=0.4):
    """Positions of a joint that moves by ``sizes`` [rad], 0.7 s apart, from ``begin`` on, recorded to ``end`` [s]."""
    time = np.arange(round(end * RATE)) / RATE - begin
    angle = np.zeros(len(time))
    for k, size in enumerate(sizes):
        share = np.clip((time - 0.7 * k) / lasting, 0.0, 1.0)
        angle += size * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    shown = gain * angle + zero + noise * np.random.default_rng(seed).normal(size=len(time))
    return trace(np.round(shown / step) * step)


@pytest.mark.parametrize("begin", [0.3104, 0.9017, 1.7003])
@pytest.mark.parametrize(("noise", "gain", "zero"), [(2e-5, 1.0, 0.0), (2e-3, 1.0, 0.0), (2e-5, 1.002, 0.3)])
def test_positions_that_begin_and_end_otherwise(begin, noise, gain, zero):
    """The lag of an encoder is within its deviation, whatever rests before and after the motion add to the means, and
    whatever its zero: within a hundredth of a sample where noise is small.
    """
    for seed in range(5):
        pair = moved(0.5, 3.0, noise, seed), moved(begin, begin + 2.6, noise, 10 + seed, gain, zero)
        found = lag([pair], [], [pair])
        apart = abs(found.seconds - (begin - 0.5))
        assert apart < 3.0 * found.deviation < (0.1 if noise < 1e-3 else 3.0) / RATE
        assert apart < 0.01 / RATE or noise > 1e-3


@pytest.mark.parametrize(
    ("sizes", "lasting", "noise", "step", "known"),
    [
        ((1.1,), 1.5, 0.0, 4e-4, 0.3),
        ((1.1,), 1.5, 0.0, 6e-3, 4.0),
        ((1.1,), 0.2, 0.0, 4e-4, 0.1),
        ((1.1,), 0.5, 2e-3, 4e-4, 0.5),
        ((0.8, -0.8), 0.4, 0.0, 6e-3, 4.0),
    ],
)
def test_an_encoder_from_rest_to_rest(sizes, lasting, noise, step, known):
    """A step in the record, whose two rests are rounded each in its own way, tells a lag of up to 0.2 s: of 20, no
    fewer than 16 are within the interval of 95 % (fewer are by chance in 1 of 390), its deviation so many ms.
    """
    waves = np.random.default_rng(3)
    truths = waves.uniform(-0.2, 0.2, 20)
    found = []
    for k, late in enumerate(truths):
        zeros = waves.uniform(0.0, step, 2)
        pair = [moved(0.9 + i * late, 3.2, noise, 2 * k + i, 1.0, zeros[i], step, sizes, lasting) for i in (0, 1)]
        found.append(lag([pair], [], [], [pair]))
    assert all("encoder" in one.by for one in found)
    deviations = np.array([one.deviation for one in found])
    errors = np.array([one.seconds for one in found]) - truths
    assert np.count_nonzero(np.abs(errors) < 1.96 * deviations) >= 16
    assert np.median(deviations) < known / RATE


def test_a_straight_line_tells_no_lag():
    """Of a counter or a ramp any lag is an offset: no deviation is stated."""
    pair = [(trace(np.arange(3000.0)), trace(np.arange(2900.0)))]
    assert lag(pair, [], pair).deviation is None


@pytest.mark.parametrize("endless", [True, False])
def test_a_period_later_as_like(endless):
    """Of a wave that does not end, or in noise that a period hardly changes, the lag may be another one: no interval,
    and why.
    """
    pair = trace(burst(0.0, 0.45, 1, 40.0)), trace(burst(0.0, 0.45, 2, 40.0))
    if endless:
        pair = [trace(np.sin((np.arange(3000) - late) / 50.0)) for late in (0.0, 5.3)]
    found = lag([pair], [], [pair])
    assert (found.deviation, traces.PERIODIC in found.by) == (None, True)
    assert found.seconds == pytest.approx(5.3e-3 if endless else 0.0, abs=1e-3)
    assert "log a trigger" in difference(*pair, found, [1.0, 1.0]).text


def test_steps_are_no_certainty():
    """Two equal records of an encoder differ by its steps, though it rests on one value."""
    pair = [trace(np.round(pulse(0.0, 0.0, 1) / 1e-4) * 1e-4) for _ in range(2)]
    apart = difference(*pair, lag([pair], [], [pair]), [1.0, 1.0])
    assert apart.half_width.read(0, 400)[1] == pytest.approx(1.96 * 1e-4 / 6**0.5, rel=0.02)


def test_encoders_of_another_logger(monkeypatch):
    """Where what vibrates tells no lag, encoders do, if their clock is related to that of the channel."""
    felt = trace(pulse(0.0, 0.3, 1)), trace(pulse(0.0, 0.3, 2))
    known = [
        replace(one, group="controller", run=one) for one in (trace(pulse(0.0, 1e-4, 3)), trace(pulse(0.1, 1e-4, 4)))
    ]
    felt = tuple(replace(one, group="daq", run=one) for one in felt)
    monkeypatch.setattr(traces, "on_clock_of", lambda run, at, source, group: ((at + 2.0, 1.96e-3), ""))
    found = lag([felt], [], [], [known])
    assert (found.seconds, found.by) == (pytest.approx(0.1, abs=1e-4), "the encoder, a")
    assert found.deviation == pytest.approx(2.0**0.5 * 1e-3, rel=0.01)


def test_clocks_are_related_where_it_moves(monkeypatch):
    """A relation that is known best amid the records counts as it does there, not as at the clock's zero."""
    known = [replace(trace(pulse(late, 1e-4, 3), start=50.0), group="controller", run=1) for late in (0.0, 0.1)]
    felt = [replace(one, group="daq") for one in known]
    monkeypatch.setattr(
        traces, "on_clock_of", lambda run, at, *of: ((at, 1.96 * (1e-4 + 1e-3 * abs(at[0] - 52.0))), "")
    )
    assert lag([felt], [], [], [known]).deviation == pytest.approx(2.0**0.5 * 1.5e-4, rel=0.2)


def switched(moment, noise, seed, kind="As recorded"):
    """A line that is switched on at a moment [s] for 0.1 s, and again 0.3 s later, with white noise."""
    time = np.arange(4000) / RATE
    on = ((time > moment) & (time < moment + 0.1)) | ((time > moment + 0.3) & (time < moment + 0.35))
    return replace(trace(5.0 * on + noise * np.random.default_rng(seed).normal(size=4000)), kind=kind)


@pytest.mark.parametrize(("noise", "kind"), [(0.0, "As recorded"), (0.02, "As recorded"), (0.5, traces.TRIGGER)])
def test_a_switch_tells_no_motion(noise, kind):
    """Of two repeats of which one began 20 ms later, a line switched 60 ms later, trigger or not, says nothing,
    neither of the lag nor of when anything began; and where it is all that was recorded, nothing does.
    """
    felt = trace(pulse(0.0, 0.01, 1)), trace(pulse(0.02, 0.01, 2))
    line = switched(0.5, noise, 3, kind), switched(0.56, noise, 4, kind)
    assert lag([line, felt], [], [line, felt]).seconds == pytest.approx(0.02, abs=0.5 / RATE)
    assert not any(one.switched for one in felt)
    assert lag([line, felt], [], []) == lag([felt], [], [])
    assert lag([line], [], [line]).by == "the first sample"


def test_encoders_tell_before_what_is_felt(monkeypatch):
    """Of repeats too: encoders of a related clock, the one that tells it most exactly, whatever the logger shows; and
    without any the channel itself, whatever the others show.
    """
    monkeypatch.setattr(traces, "on_clock_of", lambda run, at, source, group: ((at, 1.96e-4), ""))
    felt, other = (
        tuple(replace(one, group="daq", run=one) for one in (trace(pulse(0.0, 0.01, 1)), trace(pulse(late, 0.01, 2))))
        for late in (0.02, 0.03)
    )
    known = [
        tuple(replace(trace(pulse(late, noise, 5)), group="ctl", run=1, name=name) for late in (0.0, apart))
        for noise, apart, name in ((0.05, 0.015, "rough"), (1e-4, 0.01, "fine"))
    ]
    found = lag([felt, other], [], [felt, other], known)
    assert (found.seconds, found.by) == (pytest.approx(0.01, abs=1e-4), "the encoder, fine")
    assert lag([felt, other], [], [other, felt]).seconds == pytest.approx(0.03, abs=1e-3)
    assert lag([felt, other], [], [felt, other]).seconds == pytest.approx(0.02, abs=1e-3)


def test_a_difference_is_found():
    """Half the size at another rate: aligned by where both begin alone, so that no interval is given: each may show it
    half a period of its 7 Hz late, and no alignment of base accelerometers would tell more.
    """
    one, other = trace(pulse(0.0, 1e-4, 1)), trace(pulse(0.1, 1e-4, 2, 1500.0, 0.5), rate=1500.0)
    found = lag([(one, other)], [], [(one, other)])
    assert found.by == "the beginning of the motion"
    apart = difference(replace(one, kind=traces.BASE), other, found, [1.0, 1.0])
    assert apart.half_width is None
    assert float(re.search("± (.*) ms", apart.text)[1]) == pytest.approx(1e3 / 7.0 / 2.0**0.5, rel=0.05)
    assert "testbench align" not in apart.text
    _, values = difference(one, other, Lag(0.1, 0.0, "command"), [None, None]).trace.read(0, 3800)
    np.testing.assert_allclose(values, -0.5 * pulse(0.0, 0.0, 0)[:3800], atol=2e-3)


def test_of_two_conditions_what_vibrates_is_no_clock(shared):
    """Counter-masses shift the phase of what vibrates, as a lag would: the loggers, which have none, are aligned by
    where both begin, without an interval; those of the command by that.
    """
    viewer = Viewer("campaign", open_campaign(shared(PAIR).campaign).runs)
    for channel, by in (("platform_acc x", "the beginning of the motion"), ("motor_A0 A0", "the command, target x")):
        late, found = viewer._compared("r002", "r001", channel)
        assert (late.seconds, late.by, found.half_width is None) == (0.0, by, "begin" in by)


def test_an_overlay_is_what_the_viewer_draws(shared):
    """Of a pair: each run as recorded, the second at the first's instants, and their difference; what is not there."""
    runs = open_campaign(shared(PAIR).campaign).runs
    first, second = runs[::-1]
    found = overlay([first, second], "motor_A0 A0")
    (late, apart) = RunTraces([first, second]).compared(first.name, second.name, "motor_A0 A0")
    table = found.table()
    less = f"{second.name} less {first.name}"
    assert list(table) == [first.name, second.name, less, f"half width of {less}"]
    assert table.index.name == first.to_pandas(first.groups[0].name).index.name
    np.testing.assert_array_equal(table.index, found.time)
    assert (found.unit, found.lags[0].seconds) == ("N m", late.seconds)
    np.testing.assert_array_equal(table[first.name], SIRun.of(first).readings(column(first, "motor_A0")))
    np.testing.assert_allclose(table[second.name], SIRun.of(second).readings(column(second, "motor_A0")))
    np.testing.assert_array_equal(table.iloc[:, 2], apart.trace.read(0, len(table))[1])
    np.testing.assert_array_equal(table.iloc[:, 3], half := apart.half_width.read(0, len(table))[1])
    ends = dict.fromkeys(f"{one:.3g}" for one in (half.min(), half.max()))
    assert f"± {' to '.join(ends)} N m" in str(found)
    assert [axes.get_ylabel().split("\n")[1] for axes in found.plot().axes] == ["[N m]", "[N m]"]
    assert str(overlay([first, second], column(first, "motor_A0").channel)) == str(found)
    with pytest.raises(AnalysisError, match="no channel 'motor_a0 A0'; did you mean 'motor_A0 A0'"):
        overlay([first, second], "motor_a0 A0")
    with pytest.raises(AnalysisError, match="at least two runs"):
        overlay([first], "motor_A0 A0")


def column(run, sensor):
    """The only column of a sensor of a run's rig."""
    (found,) = (one for one in SIRun.of(run).rig.columns() if one.sensor == sensor)
    return found


def test_the_command_aligns():
    """Loggers on the command's clock are aligned by it, whatever their own channels show."""
    commands = trace(pulse(0.0, 0.0, 0), name="target x"), trace(pulse(0.05, 0.0, 0), name="target x")
    shown = trace(pulse(0.0, 0.1, 1)), trace(pulse(0.3, 0.1, 2))
    assert lag([shown], [commands], [shown]).seconds == pytest.approx(0.05, abs=1e-4)


@pytest.fixture(scope="module")
def campaign(shared, tmp_path_factory):
    """Two runs of one condition, with and without counter-masses, and one without a rig, with hostile names."""
    folder = tmp_path_factory.mktemp("view") / "campaign"
    shutil.copytree(shared(PAIR).campaign, folder)
    group = Group(HOSTILE, (Channel(HOSTILE, "<b>"),), UniformClock(RATE))
    with RunWriter(folder, "r003") as writer:
        writer.group(group).append([pulse(0.0, 0.1, 1)])
        writer.group(group).finish(RATE, "declared")
        writer.describe("simulated", {"motion": HOSTILE}, [], {"sources": []}, None)
        writer.commit()
    return folder


def contradiction(run, code):
    """What a witness states of a run."""
    return Statement(run, "copy", None, "stated", "witnessed", "a witness", code)


def test_findings_are_accepted_by_a_person(shared, tmp_path):
    """With name and reason, for the runs that have it: recorded, in the ledger, in force in analyses, until removed."""
    folder = tmp_path / "campaign"
    shutil.copytree(shared(PAIR).campaign, folder)
    viewer = Viewer("campaign", open_campaign(folder).runs)
    viewer.examination = Examination(("r001", "r002"), (contradiction("r002", "copied_run"),), {})

    def decision(found):
        return next(one["decision"] for one in found["findings"] if one["code"] == "copied_run")

    assert decision(viewer.findings({})) == "open"
    words = {"code": "copied_run", "by": "A. Kaya", "reason": HOSTILE}
    for wrong, message in (
        ({"by": " "}, "a name"),
        ({"reason": ""}, "a reason"),
        ({"code": "level_drift"}, "no finding"),
    ):
        with pytest.raises(StoreError, match=message):
            viewer.accept(words | wrong)
    assert decision(viewer.accept(words)).startswith("accepted by A. Kaya")
    entry = read_ledger(folder).entries[-1]
    assert (entry.kind, entry.details["by"], entry.details["code"]) == ("record", "A. Kaya", "copied_run")
    assert viewer.examination.copied == {"r002"}
    assert not viewer.examination.decided(viewer.runs).copied
    assert "copied_run" in examine([viewer.runs[1]]).accepted
    call("remove", folder / entry.file, "--by", "A. Kaya", "--reason", "it was no copy")
    assert viewer.examination.decided(viewer.runs).copied


def test_a_run_that_was_changed_is_not_spoken_for(shared, tmp_path):
    """Another run under the name of one that was opened: neither accepted nor drawn as the one that was looked at."""
    folder = tmp_path / "campaign"
    shutil.copytree(shared(PAIR).campaign, folder)
    viewer = Viewer("campaign", open_campaign(folder).runs)
    viewer.examination = Examination(("r001", "r002"), (contradiction("r002", "copied_run"),), {})
    digest = folder / "r002.h5.sha256"
    digest.write_text(digest.read_text().translate(str.maketrans("0123456789", "1234567890")))
    words = {"run": "1", "first": "1", "channel": "0", "from": "0", "to": "1", "spans": "100"}
    for ask, given in (
        (viewer.samples, words),
        (viewer.accept, {"code": "copied_run", "by": "A. Kaya", "reason": "on purpose"}),
    ):
        with pytest.raises(StoreError, match="r002: was changed since it was opened"):
            ask(given)
    assert not (folder / "records").exists()


def test_runs_of_one_name_are_refused(shared):
    """Two campaigns both have an r001: which of them is meant could not be told."""
    done = call("view", *2 * [shared(PAIR).campaign], "--no-browser", "--idle", "0")
    assert (done.code, "r001: of several campaigns" in done.err) == (1, True)


def test_a_run_without_a_rig_that_can_be_read(tmp_path):
    """It is shown as recorded, with the reason, and keeps no other run from the page."""
    group = Group("g", (Channel("a", "V"),), UniformClock(RATE))
    with RunWriter(tmp_path, "r001") as writer:
        writer.group(group).append([pulse(0.0, 0.1, 1)])
        writer.group(group).finish(RATE, "declared")
        writer.describe("measured", {}, [], {"sources": []}, "no [ rig")
        writer.commit()
    viewer = Viewer("campaign", open_campaign(tmp_path).runs)
    assert "r001</bdi>: as recorded, without its rig: stored rig: not a TOML file" in viewer.page().html()
    assert [one.kind for one in viewer._traces.of("r001").values()] == ["As recorded"]


def test_of_other_runs_nothing_is_accepted(campaign):
    """A decision about one run does not hold for another: the code stays open."""
    runs = {run.name: run for run in open_campaign(campaign).runs}
    accept(campaign, "level_drift", [runs["r001"]], "A. Kaya", "a warm day")
    for names, expected in ((["r001"], {"level_drift"}), (["r001", "r002"], set())):
        found = Examination(tuple(runs), tuple(contradiction(name, "level_drift") for name in names), {})
        assert found.decided(runs.values()).accepted == expected


@pytest.fixture(scope="module")
def served(campaign):
    """The viewer of these runs at work."""
    viewer = Viewer(HOSTILE, open_campaign(campaign).runs)
    viewer.examination = Examination(tuple(run.name for run in viewer.runs), (), {})
    server = viewer.server()
    Thread(target=server.serve, daemon=True).start()
    yield server
    server.asked = float("-inf")


def test_in_a_browser(browser, serious, served):
    """Loads, zooms to every sample, moves, overlays three runs, spectra; names stay text; nothing else is asked for.

    Axe finds nothing serious.
    """
    view = browser.new_page()
    odd, asked = [], []
    view.on("console", lambda message: odd.append(message.text))
    view.on("pageerror", lambda error: odd.append(str(error)))
    view.on("request", lambda request: asked.append(request.url))
    view.goto(served.url)
    plots, note = view.locator("#series-plots canvas"), view.locator("#series-note")
    view.wait_for_selector("#series-plots canvas")
    assert plots.count() == 6
    assert "r001 is drawn" in note.inner_text()
    assert "no interval: aligned by the beginning" in view.inner_text("#series-plots")
    view.select_option("#series-kind", "Torque of the drives")
    view.wait_for_function("() => document.getElementById('series-plots').innerText.includes('less r002: ±')")
    view.select_option("#series-kind", "Acceleration of the base")
    view.wait_for_function("() => document.querySelectorAll('#series-plots canvas').length == 6")
    view.focus("#series-plots .plot >> nth=0")
    for _ in range(5):
        view.keyboard.press("+")
    view.wait_for_function("() => document.getElementById('series-note').textContent.startsWith('Every sample')")
    shown = view.inner_text("#series-plots p >> nth=0")
    before = len(asked)
    for _ in range(30):
        view.keyboard.press("ArrowRight")
    view.wait_for_function("old => document.querySelector('#series-plots p').textContent != old", arg=shown)
    view.wait_for_timeout(500)
    low, high = map(float, re.findall("From (.*) to (.*) s:", view.inner_text("#series-plots p >> nth=0"))[0])
    ranges = [float(to) - float(begin) for url in asked[before:] for begin, to in re.findall("from=(.*)&to=(.*)&", url)]
    # Asked for ahead of where the view moves: two widths, and a quarter behind.
    assert pytest.approx(3.25 * (high - low), rel=0.02) in ranges
    view.select_option("#series-over", "frequency")
    view.wait_for_function("() => document.getElementById('series-note').textContent.startsWith('Power')")
    assert plots.count() == 3
    view.select_option("#series-over", "time")
    view.select_option(
        "#series-b",
        label=[text for text in view.locator("#series-b option").all_inner_texts() if text[:4] in ("r001", "r003")],
    )
    view.select_option("#series-kind", "As recorded")
    view.wait_for_function("() => document.querySelector('#series-plots h3')?.textContent.includes('script')")
    assert view.title() == "View of " + HOSTILE.replace("\u202e", "\\x202e")
    view.wait_for_function("() => document.getElementById('findings-state').textContent.includes('runs')")
    assert serious(view) == []
    assert odd == []
    assert all(url.startswith(served.url) for url in asked)
    view.close()


def test_accepts_in_the_browser(browser, served, monkeypatch):
    """A finding's form: name and reason; the answer is the list anew, its texts as text."""
    view = browser.new_page()
    finding = {"code": "copied_run", "count": 1, "decision": "open", "meaning": HOSTILE, "messages": [HOSTILE]}
    given = []

    def accepted(words):
        given.append(words)
        return {"verdict": "done", "findings": [finding | {"decision": "accepted by A. Kaya"}]}

    monkeypatch.setitem(served.answers["GET"], "findings", lambda _: {"verdict": "v", "findings": [finding]})
    monkeypatch.setitem(served.answers["POST"], "accept", accepted)
    view.goto(served.url)
    view.click("#findings-list summary")
    assert view.inner_text("#findings-list li") == HOSTILE.replace("\u202e", "\\x202e")
    view.fill("#findings-list input >> nth=0", "A. Kaya")
    view.fill("#findings-list input >> nth=1", "a copy on purpose")
    view.click("#findings-list button")
    view.wait_for_function("() => document.getElementById('findings-state').textContent == 'done'")
    assert given == [{"code": "copied_run", "by": "A. Kaya", "reason": "a copy on purpose"}]
    assert view.locator("#findings-list form").count() == 0
    view.close()
