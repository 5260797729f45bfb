"""The spectrum of noise: power and degrees of freedom against closed forms, pooling, low frequencies, what is too
short."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from testbench.signal.filters import Band
from testbench.vibration import Noise, motion_timing, noise_floor
from testbench.vibration.metrics import Measure
from testbench.vibration.noise_floor import Draws, NoiseRecords, Segment, noise_draws, tapers

RATE = 1000.0
PASSED = 0.875 * (np.pi / 8) / np.sin(np.pi / 8)
"""Of white noise below its edge a band passes the integral of (1 + x^8)^-2."""


def white(seed: int, count: int, size: float = 1.0) -> Segment:
    """A rest in white noise."""
    return Segment(size * np.random.default_rng(seed).normal(size=count), RATE)


def white_of(rng: np.random.Generator, count: int) -> np.ndarray:
    """White noise of power one."""
    return rng.normal(size=count)


def test_tapers():
    """Sines of one, two and three half periods, orthogonal and of power one."""
    sines = np.sin(np.pi * np.outer([1, 2, 3], np.arange(1, 1000)) / 1000) * (2.0 / 1000) ** 0.5
    np.testing.assert_allclose(tapers(999), sines, atol=1e-14)
    np.testing.assert_allclose(sines @ sines.T, np.eye(3), atol=1e-12)


def test_white_noise():
    """White noise of standard deviation 2 has the power 4 in all frequencies, and a fifth of it in a fifth of them."""
    noise = Noise.of([white(1, 20_000, 2.0)])
    assert noise.power(None)[0] == pytest.approx(4.0, rel=0.03)
    assert noise.power(Band(0.0, 100.0))[0] == pytest.approx(0.8 * PASSED, rel=0.08)


def test_how_well_it_is_known():
    """The power of many rests scatters no more than its degrees of freedom say, which count every cell as a narrow
    mode.
    """
    band = Band(0.0, 100.0)
    powers, freedom = np.array([Noise.of([white(k, 400)]).power(band) for k in range(200)]).T
    assert powers.std() / powers.mean() <= np.sqrt(2.0 / np.median(freedom))
    assert powers.std() / powers.mean() == pytest.approx(np.sqrt(2.0 / np.median(freedom)), rel=0.6)


def mode(rng: np.random.Generator, count: int) -> np.ndarray:
    """Noise of power one: a mode of 12 Hz with 1 % damping, hit by white noise for long, and beside it white noise."""
    pole = np.exp(2j * np.pi * 12.0 / RATE * np.exp(1j * np.arccos(-0.01)) / 1j)
    wave = lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], rng.normal(size=count + 8000))[8000:]
    power = (1.0 + abs(pole) ** 2) / (1.0 - abs(pole) ** 2) / abs(1.0 - pole**2) ** 2
    return np.sqrt(0.8 / power) * wave + np.sqrt(0.2) * rng.normal(size=count)


@pytest.mark.parametrize(
    ("made", "seconds", "narrower"), [(white_of, 1.0, 0.5), (white_of, 0.3, 0.6), (mode, 0.3, 1.1)]
)
def test_powers_that_a_rest_allows(made, seconds, narrower):
    """Powers drawn from one rest hold the true one about as often as if every cell were a narrow mode; of white noise,
    which is known by all its frequencies, they are much closer together. Of a narrow mode a rest shows one amplitude.
    """
    hits, widths, frequency = [], [], np.arange(0.0, 500.0, 0.25)
    for seed in range(60):
        noise = Noise.of([Segment(made(np.random.default_rng([seed, 4]), round(seconds * RATE)), RATE)])
        for one in (noise, replace(noise, freedom_broad=None)):
            drawn = one.draws(frequency, np.ones(len(frequency)), 400, np.random.default_rng(seed)).astype(float)
            low, high = np.quantile((drawn**2).sum(axis=1) * 0.25, (0.025, 0.975))
            hits.append(low <= 1.0 <= high)
            widths.append(np.log(high / low))
    assert sum(hits[::2]) >= sum(hits[1::2]) - 4  # Monte Carlo of 300 rests with a mode: 87 % and 90 %
    assert sum(hits[::2]) >= (46 if made is mode else 55)
    assert np.median(widths[::2]) < narrower * np.median(widths[1::2])


def test_a_mode_is_known_to_its_own_cells_alone():
    """What stands above the cells about it may be one amplitude; what all cells have is known by all of each."""
    noise = Noise.of([Segment(mode(np.random.default_rng(3), 1000), RATE)])
    freedoms = noise._freedoms(120)
    assert freedoms[3] == pytest.approx(noise.freedom, rel=0.1)  # 12 to 16 Hz
    assert np.median(freedoms[10:]) > 0.7 * noise.freedom_broad > 1.2 * noise.freedom


@pytest.mark.parametrize(("line", "left"), [(1.0, 0.0), (2.0, 3.0)])
def test_errors_of_lines_are_taken_off(line, left):
    """Where lines were taken out, what repeats do not share shows by how much they were wrong, which is drawn by
    itself; more than that, as of a drive that hums, stays. Nothing falls below the noise about it.
    """
    rng, time = np.random.default_rng(5), np.arange(1000) / RATE
    waves = np.stack([np.cos(2.0 * np.pi * 50.0 * time), np.sin(2.0 * np.pi * 50.0 * time)])
    shown = [Segment(0.3 * rng.normal(size=1000) + line * phase @ waves, RATE) for phase in np.eye(2)[[0, 1, 0, 1]]]
    noise, band = Noise.of(shown), Band(42.0, 58.0)
    found = noise.without_lines(Noise.of([Segment(wave, RATE) for wave in waves]))
    beside, before, after = (one.power(b)[0] for one, b in ((found, Band(62.0, 78.0)), (noise, band), (found, band)))
    assert before == pytest.approx(beside + 0.5 * line**2, rel=0.1)
    assert after == pytest.approx(beside + 0.5 * left, abs=0.02 * before)
    far = abs(noise.frequency - 50.0) > 12.0
    assert found.density[far] == pytest.approx(noise.density[far], rel=0.02)


def test_pooling():
    """Four rests know as much as one of four times their degrees of freedom."""
    one, four = Noise.of([white(1, 400)]), Noise.of([white(k, 400) for k in range(4)])
    assert four.freedom == pytest.approx(4.0 * one.freedom, rel=0.4)
    assert four.scatter == 0.0


def test_rests_that_disagree():
    """Rests of very different power make the next one uncertain by as much."""
    noise = Noise.of([white(k, 400, size) for k, size in enumerate((1.0, 1.0, 8.0, 8.0))])
    assert noise.scatter > 1.0


@pytest.mark.parametrize(("slope", "most"), [(0, 0.75), (1, 2.0)])
def test_below_the_first_frequency(slope, most):
    """Below 1 / T the density rises like that of the octaves above: as a random walk does, or hardly."""
    rng = np.random.default_rng(2)
    values = rng.normal(size=400) if slope == 0 else np.cumsum(rng.normal(size=400))
    noise = Noise.of([Segment(values, RATE)])
    below, at_rest = noise.draws(noise.lowest_hz * np.array([0.25, 1.0]), np.ones(2), 4000, rng).T ** 2
    assert 0.0 <= np.median(np.log(below / at_rest)) / np.log(4.0) <= most + 0.3


def test_steps():
    """The density is nowhere less than that of the steps."""
    noise = Noise.of([Segment(np.zeros(500), RATE)], 1e-4)
    assert noise.density == pytest.approx(np.full_like(noise.density, 1e-4))


@pytest.mark.parametrize("values", [np.zeros(9), np.zeros(20)])
def test_too_short(values):
    """A handful of samples make no spectrum."""
    assert Noise.of([Segment(values, RATE)]) is None


def test_a_rig_that_states_none():
    """A stated noise of zero is none."""
    assert Noise.stated(0.0, RATE) is None
    assert Noise.stated(2.0, RATE).power(None)[0] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("size", [0.01, 0.3, 3.0])
def test_highest_of_signals_in_noise(size):
    """What is left out near no extreme changes none: as by all samples of every draw, noise small and large."""
    draws = noise_draws(Noise.of([white(1, 4000, size)]), Measure(), 900, RATE)
    swing = np.sin(np.linspace(0.0, 60.0, 900)) * np.exp(-np.linspace(0.0, 4.0, 900))
    signals = np.linspace(0.5, 1.5, 9)[:, None] * swing
    noise = np.concatenate(draws.parts).T
    for sign in (1, -1):
        whole = np.array([(sign * noise + signal).max(axis=1) for signal in signals]).T
        found = NoiseRecords(draws, np.zeros(len(noise))).highest(np.arange(900), signals, sign)
        np.testing.assert_allclose(found, whole, atol=1e-5 * max(size, 1.0))  # single precision


@pytest.mark.parametrize("order", [np.ascontiguousarray, np.asfortranarray])
def test_compiled_loops_find_the_same(monkeypatch, order):
    """Whether filters of long records have loaded compiled loops or not changes no bit, however draws lie in memory."""
    loops = pytest.importorskip("testbench.signal.compiled_loops")
    draws = noise_draws(Noise.of([white(1, 4000)]), Measure(), 900, RATE)
    draws = replace(draws, parts=tuple(map(order, draws.parts)))
    signals = np.linspace(2.0, 5.0, 9)[:, None] * np.sin(np.linspace(0.0, 60.0, 900))
    tops, found = signals.max(axis=1), {}
    records = NoiseRecords(draws, np.linspace(-0.1, 0.2, len(draws.powers)), 0.7)
    for used in (loops, None):
        monkeypatch.setattr(noise_floor, "loaded_loops", lambda used=used: used)
        found[used] = [
            each
            for sign in (1, -1)
            for each in (
                records.highest(np.arange(900), signals, sign),
                records.excess(np.arange(900), signals, tops, records.rounding, sign),
            )
        ]
    np.testing.assert_array_equal(found[loops], found[None])
    assert found[None][1].min() > 0.0


def test_compiled_loops_foresee_the_same(monkeypatch):
    """Nor does it change, but for rounding, when a motion is found to begin."""
    loops = pytest.importorskip("testbench.signal.compiled_loops")
    rows, found = np.random.default_rng(3).normal(size=(3, 500)).cumsum(axis=1), []
    for used in (loops, None):
        monkeypatch.setattr(motion_timing, "loaded_loops", lambda used=used: used)
        found.append(motion_timing._innovations(rows, 300))
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)
    assert found[0][:, 300:].mean() == pytest.approx(1.0, abs=0.3)


def test_shared_draws():
    """Draws of a shorter record are the same ones with their middle left out, of the noise's power in the band."""
    noise = Noise.of([white(1, 20_000)])
    whole, shorter = (np.concatenate(noise_draws(noise, Measure(), count, RATE).parts) for count in (2048, 2000))
    np.testing.assert_array_equal(whole[:1000], shorter[:1000])
    np.testing.assert_array_equal(whole[-1000:], shorter[-1000:])
    assert np.mean(whole.astype(float) ** 2) == pytest.approx(noise.power(Measure().band)[0], rel=0.1)


def test_two_threads_draw_once():
    """What both ask for at the same time is one set of draws."""
    noise = Noise.of([white(2, 4000)])
    with ThreadPoolExecutor(2) as pool:
        one, other = pool.map(lambda _: noise_draws(noise, Measure(), 4000, RATE), range(2))
    assert one is other


def test_noise_records_in_multiples():
    """Noise three times as large: powers and mean squares nine times, ends three times."""
    draws = Draws((np.random.default_rng(2).normal(size=(40, 3)),), np.ones(3))
    one, three = (NoiseRecords(draws, np.zeros(3), scale) for scale in (1.0, 3.0))
    np.testing.assert_allclose(three.powers, 9.0 * one.powers)
    np.testing.assert_allclose(three.mean_squares, 9.0 * one.mean_squares)
    np.testing.assert_allclose(three.ends, 3.0 * np.array(one.ends))


@pytest.mark.parametrize("half_s", [0.05, 0.2, 1.0, 3.0])
@pytest.mark.parametrize("law", ["bang-bang", "cycloid", "fifth order", "seventh order"])
@pytest.mark.parametrize("step", [0.0, 1e-4])
def test_encoders_tell_from_when_on_they_move(half_s, law, step):
    """Not after the first push, which a base feels long before an encoder has turned by a step; not long before."""
    time = np.arange(0.0, 2.0 + 4.0 * half_s, 5e-4)
    at = np.clip((time - 1.0) / (2.0 * half_s), 0.0, 1.0)
    way = {
        "bang-bang": np.where(at < 0.5, 2.0 * at**2, 1.0 - 2.0 * (1.0 - at) ** 2),
        "cycloid": at - np.sin(2.0 * np.pi * at) / (2.0 * np.pi),
        "fifth order": at**3 * (10.0 - 15.0 * at + 6.0 * at**2),
        "seventh order": at**4 * (35.0 - 84.0 * at + 70.0 * at**2 - 20.0 * at**3),
    }[law]
    way = 0.7 * way
    read = np.round(way / step) * step if step else way
    (begin, end), _ = motion_timing._encoded_motion(np.column_stack([read, 0.0 * read]), time)
    pushed = np.abs(np.gradient(np.gradient(way)))
    before = np.interp(begin, time, pushed / pushed.max())
    assert before < 0.05
    assert 1.0 - 0.16 * half_s < begin < 1.0 + 0.08 * half_s
    assert abs(end + begin - 2.0 - 2.0 * half_s) < 0.02 * half_s + 2e-3


def test_a_jump_of_an_encoder_is_no_long_motion():
    """A brake lets go at 0.36 s, the stroke begins at 1.1 s: there is rest before the jump."""
    time = np.arange(0.0, 2.0, 1e-3)
    at = np.clip((time - 1.1) / 0.4, 0.0, 1.0)
    way = 0.5 * at**3 * (10.0 - 15.0 * at + 6.0 * at**2) + 0.002 * (time >= 0.36)
    (begin, _), _ = motion_timing._encoded_motion(way[:, None], time)
    assert 0.35 <= begin <= 0.36


@pytest.mark.parametrize("steps", [20, 48, 100, 400])
@pytest.mark.parametrize("rest", [0.0, 0.37, 0.9])
def test_coarse_encoders_tell_the_stroke_by_their_steps(steps, rest):
    """So few steps a stroke, wherever within one it rests: neither end of the motion counts as rest."""
    time = np.arange(0.0, 2.0, 1e-3)
    at = np.clip((time - 0.5) / 0.6, 0.0, 1.0)
    way = np.floor(rest + steps * at**3 * (10.0 - 15.0 * at + 6.0 * at**2))
    (begin, end), _ = motion_timing._encoded_motion(way[:, None], time)
    assert 0.3 < begin < 0.505
    assert 1.095 < end < 1.3


@pytest.mark.parametrize("flicker", [0, 300])
@pytest.mark.parametrize("start", [0.0, 0.1234, 3.1])
def test_an_encoder_that_flickers_rests(flicker, start):
    """By one step of 0.04 deg, which in radians is a step more or less 1e-16: as if it had not."""
    time, step = np.arange(0.0, 4.0, 1e-3), np.radians(0.04)
    at = np.clip(time - 2.0, 0.0, 1.0)
    counts = np.round((start + at**3 * (10.0 - 15.0 * at + 6.0 * at**2)) / step)
    other = counts.copy()
    other[flicker] += 1.0
    one, two = (motion_timing._encoded_motion(step * way[:, None], time)[0] for way in (counts, other))
    assert one == two
    assert 1.9 < one[0] < 2.01


@pytest.mark.parametrize(("angle", "begins"), [(3.0, 0.0), (0.0, None)])
def test_encoders_in_motion_at_once_begin_at_once(angle, begins):
    """A swing that goes on when the log begins is no rest; a first value from before the first reading is no motion."""
    time = np.arange(0.0, 2.0, 1e-3)
    way = angle * np.sin(9.0 * time + 0.4)
    way[0] += 0.5 * (angle == 0.0)
    span, _ = motion_timing._encoded_motion(way[:, None], time)
    assert (span and span[0]) == begins
