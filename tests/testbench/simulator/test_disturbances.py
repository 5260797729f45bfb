"""Floor and roughness have the densities that they state, and shake the base as a linear body."""

import numpy as np
import pytest

from testbench.errors import RigError
from testbench.rig import load_rig, rig_from_text
from testbench.rig.bench import Bench
from testbench.simulator.disturbances import (
    FLOOR_VELOCITY,
    draw_disturbance,
    flat_density,
    floor_density,
    fourier_lines,
)

STEP, COUNT = 1e-3, 60_000


def drawn(seed: int = 1, **settings):
    """A minute of the default bench."""
    bench = Bench.model_validate(settings)
    return bench.elastic(), draw_disturbance(bench, bench.elastic(), COUNT, STEP, (7, seed))


def density(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One-sided density by Welch's method in bands of 1 Hz."""
    from scipy.signal import welch

    return welch(signal, 1.0 / STEP, nperseg=1000, detrend=False)


def test_lines():
    """The mean square of a signal is the area under its density, and Welch finds the density."""
    f = np.fft.rfftfreq(COUNT, STEP)
    stated = flat_density(2.0, (50.0, 250.0), f)
    signal = np.fft.irfft(fourier_lines(stated, np.random.default_rng(3), COUNT, STEP), COUNT)
    assert signal.std() == pytest.approx(2.0, rel=0.02)
    found_at, found = density(signal)
    inside = (found_at > 60) & (found_at < 240)
    assert found[inside].mean() == pytest.approx(4.0 / 200.0, rel=0.03)
    assert found[(found_at < 45) | (found_at > 255)].max() < 1e-3 * found[inside].mean()


@pytest.mark.parametrize("level", ["workshop", "VC-A", "VC-C"])
def test_floor_fills_the_curve(level):
    """In each third-octave band from 8 to 63 Hz the velocity is the curve's; below, the curves to VC-B rise."""
    df = 0.01
    f = np.arange(0.0, 200.0, df)
    velocity = floor_density(level, f) * (2.0 * np.pi * f) ** 2

    def band(centre: float) -> float:
        inside = (f >= centre * 2 ** (-1 / 6)) & (f < centre * 2 ** (1 / 6))
        return float(np.sqrt(velocity[inside].sum() * df))

    for centre in (10.0, 16.0, 31.5, 63.0):
        assert band(centre) == pytest.approx(FLOOR_VELOCITY[level], rel=0.01)
    assert band(5.0) / FLOOR_VELOCITY[level] == pytest.approx(1.0 if level == "VC-C" else 1.6, rel=0.02)
    assert not velocity[(f < 4.0) | (f > 80.0)].any()


def test_transmissibility():
    """The base answers the floor with (K - w2 M + i w C)^-1 (K + i w C): densities in, densities out."""
    body, found = drawn(floor="VC-A")
    at, acceleration = density(found.motion.acceleration[:, 1])
    for f in (12.0, 20.0, 45.0):
        omega = 2 * np.pi * f
        mounts = body.stiffness + 1j * omega * body.damping
        gain = np.linalg.solve(mounts - omega**2 * body.mass, mounts)[1, :3]
        expected = (np.abs(gain) ** 2).sum() * float(floor_density("VC-A", np.array([f]))[0]) * omega**4
        near = np.abs(at - f) < 1.5
        assert acceleration[near].mean() == pytest.approx(expected, rel=0.3)


def test_equation_of_motion():
    """Rates are those of the displacement, and the roughness moves the base: M x'' + C x' + K x = w."""
    body, found = drawn(roughness={"force": "2 N", "moment": "0.1 N m", "band": ["20 Hz", "300 Hz"]})
    m = found.motion
    left = m.acceleration @ body.mass.T + m.velocity @ body.damping.T + m.displacement @ body.stiffness.T
    np.testing.assert_allclose(left, found.wrench, rtol=0, atol=1e-9)
    assert found.wrench.std(axis=0) == pytest.approx([2.0] * 3 + [0.1] * 3, rel=0.03)
    slope = np.gradient(m.displacement[:, 0], STEP)[1:-1]
    assert np.abs(slope - m.velocity[1:-1, 0]).std() < 0.05 * m.velocity[:, 0].std()


def test_stationary():
    """It shakes from the first sample on as later, and does not trail off."""
    _, found = drawn(floor="workshop")
    parts = found.motion.acceleration[:, 1].reshape(6, -1).std(axis=1)
    assert parts == pytest.approx([parts.mean()] * 6, rel=0.2)
    assert found.motion.acceleration[:200, 1].std() > 0.5 * parts.mean()


def test_each_drawn_for_itself():
    """The same seed gives the same; another another; the floor does not change with the roughness."""
    _, once = drawn(floor="VC-A")
    _, again = drawn(floor="VC-A")
    _, other = drawn(seed=2, floor="VC-A")
    body, both = drawn(floor="VC-A", roughness={"force": "1 N"})
    assert np.array_equal(once.motion.acceleration, again.motion.acceleration)
    assert abs(np.corrcoef(once.motion.velocity[:, 1], other.motion.velocity[:, 1])[0, 1]) < 0.1
    m = both.motion
    less = both.wrench - (m.acceleration - once.motion.acceleration) @ body.mass.T
    rest = (m.velocity - once.motion.velocity) @ body.damping.T
    carried = (m.displacement - once.motion.displacement) @ body.stiffness.T
    np.testing.assert_allclose(less - rest, carried, rtol=0, atol=1e-9)


def test_nothing_stated():
    """A bench without floor and roughness draws nothing."""
    assert drawn()[1] is None


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('floor = "VC-Z"', "bench.floor: 'VC-Z': expected"),
        ('roughness = { force = "1 N", band = ["50 Hz", "20 Hz"] }', "bench.roughness: band: expected a lower"),
        ('roughness = { force = "1 m" }', "bench.roughness.force"),
    ],
)
def test_refused(more, said):
    """What a rig cannot mean is blamed by its key."""
    text = load_rig("parallelogram-6bar").text
    head, tail = text.split("[[bench.mounts]]", 1)
    with pytest.raises(RigError, match=said):
        rig_from_text(head + more + "\n[[bench.mounts]]" + tail)
