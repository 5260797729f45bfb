"""Floor and roughness have the densities that they state, and shake the base as a linear body."""

import numpy as np
import pytest

from balance.dynamics.moving_base import apparent_gravity
from testbench.errors import RigError
from testbench.rig import load_rig, rig_from_text
from testbench.rig.bench import Bench
from testbench.simulator.disturbances import (
    FLOOR_VELOCITY,
    draw_disturbance,
    flat_density,
    floor_density,
    floor_lines,
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


TURNING = {
    "frequency": "6 Hz",
    "damping": 0.03,
    "angle": "0.2 mrad",
    "axis": [2, 0, 0],
    "centre": ["0 m", "0.4 m", "-1.5 m"],
}
ALONG = {"frequency": "9 Hz", "damping": 0.05, "acceleration": "0.02 m/s^2", "axis": [0, 3, 4]}
GRAVITY = np.array([0.0, 0.0, -9.81])


def floor_of(bench: Bench, count: int, seed: int = 1) -> np.ndarray:
    """Lines of its displacement and rotation (m, 6)."""
    return floor_lines(bench, np.fft.rfftfreq(count, STEP), count, STEP, (7, seed))


def test_modes_of_the_floor_are_as_large_as_stated():
    """Over seeds the mean squares are those stated, whatever the record's length; a mode of no angle is still."""
    rate = 2j * np.pi * np.fft.rfftfreq(2000, STEP)[:, None]
    for mode, power, stated in ((TURNING, 0, 2e-4), (ALONG, 2, 0.02)):
        bench = Bench.model_validate({"floor_modes": [mode]})
        axis = np.array(mode["axis"]) / np.linalg.norm(mode["axis"])
        part = slice(3, 6) if power == 0 else slice(0, 3)
        signals = [
            np.fft.irfft(rate**power * floor_of(bench, 2000, k)[:, part] @ axis[:, None], axis=0) for k in range(600)
        ]
        # The power of a record that shows some ten lines of the mode scatters by a third: of 600, by 1.5 %.
        assert np.sqrt(np.mean(np.square(signals))) == pytest.approx(stated, rel=0.04)
    assert not floor_of(Bench.model_validate({"floor_modes": [{**TURNING, "angle": "0 rad"}]}), 2000).any()


@pytest.mark.parametrize("mode", [TURNING, ALONG])
def test_stiff_mounts_follow_the_floor(mode):
    """On stiff mounts each point of the base moves by u + theta x r of the floor."""
    stiff = [{"position": p, "stiffness": "1e13 N/m", "damping": "1 N s/m"} for p in FEET]
    bench = Bench.model_validate({"floor_modes": [mode], "mounts": stiff})
    moved = draw_disturbance(bench, bench.elastic(None, GRAVITY), 2000, STEP, (7, 1)).motion.displacement
    expected = np.fft.irfft(floor_of(bench, 2000), axis=0)
    # 80 Hz below the natural frequencies of 1e5 Hz: (80 / 1e5)^2.
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    if mode is TURNING:
        centre = np.array([0.0, 0.4, -1.5])
        np.testing.assert_allclose(expected[:, :3] + np.cross(expected[:, 3:], centre), 0.0, atol=1e-15)


FEET = [[f"{x} m", f"{y} m", "0 m"] for x in (-0.4, 0.4) for y in (-0.3, 0.3)]


def test_rocking_against_hand_written_equations():
    """A block above four springs on a rocking floor, in gravity: Newton and Euler by hand, integrated by scipy."""
    from scipy.integrate import solve_ivp

    m, h, inertia, b, k, kz, c, cz = 100.0, 0.3, 9.0, 0.3, 2e5, 4e5, 200.0, 300.0
    feet = [
        {"position": p, "stiffness": [f"{k} N/m", f"{k} N/m", f"{kz} N/m"],
         "damping": [f"{c} N s/m", f"{c} N s/m", f"{cz} N s/m"]}
        for p in FEET
    ]  # fmt: skip
    stated = {"mass": f"{m} kg", "centre": ["0 m", "0 m", f"{h} m"], "inertia": f"{inertia} kg m^2", "mounts": feet}
    bench = Bench.model_validate({**stated, "floor_modes": [{**TURNING, "centre": ["0 m", "0 m", "-1.5 m"]}]})
    count = 1000
    found = draw_disturbance(bench, bench.elastic(None, GRAVITY), count, STEP, (7, 1)).motion
    lines = floor_of(bench, count)[:81, 3] * 2.0 / count
    rate = 2j * np.pi * np.arange(81)

    def slope(t, state):
        y, phi, dy, dphi = state
        wave = lines * np.exp(rate * t)
        theta, turning = wave.sum().real, (rate * wave).sum().real
        force = -4 * k * (y + 1.5 * theta) - 4 * c * (dy + 1.5 * turning)
        moment = -4 * b**2 * (kz * (phi - theta) + cz * (dphi - turning)) + m * 9.81 * h * phi
        return dy, dphi, *np.linalg.solve([[m, -m * h], [-m * h, inertia + m * h**2]], [force, moment])

    start = [*found.displacement[0, [1, 3]], *found.velocity[0, [1, 3]]]
    time = STEP * np.arange(count)
    by_hand = solve_ivp(slope, (0.0, time[-1]), start, "DOP853", time, rtol=1e-9, atol=1e-14).y
    for own, other in ((found.displacement, by_hand[:2]), (found.velocity, by_hand[2:])):
        np.testing.assert_allclose(own[:, [1, 3]].T, other, rtol=0, atol=1e-6 * np.abs(other).max())
    sensed = apparent_gravity(GRAVITY, found.displacement)[:, 1]
    np.testing.assert_allclose(sensed, 9.81 * by_hand[1], rtol=0, atol=1e-6 * np.abs(sensed).max())


def test_nothing_stated():
    """A bench without floor and roughness draws nothing."""
    assert drawn()[1] is None


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('floor = "VC-Z"', "bench.floor: 'VC-Z': expected"),
        ('roughness = { force = "1 N", band = ["50 Hz", "20 Hz"] }', "bench.roughness: band: expected a lower"),
        ('roughness = { force = "1 m" }', "bench.roughness.force"),
        *(
            (f'floor_modes = [{{ frequency = "{hz} Hz", damping = 0.1, {keys} }}]', rf"bench.floor_modes\[0\].*{said}")
            for hz, keys, said in (
                (5, 'angle = "1 mrad", axis = [0, 0, 0]', r"axis: \[0, 0, 0\]: expected a direction"),
                (5, "axis = [1, 0, 0]", "expected acceleration, of a mode"),
                (
                    5,
                    'acceleration = "1 m/s^2", axis = [1, 0, 0], centre = ["1 m", "0 m", "0 m"]',
                    "centre: expected only",
                ),
                (90, 'angle = "1 mrad", axis = [1, 0, 0]', "frequency: expected less than 80 Hz"),
                (5, 'angle = "1 m", axis = [1, 0, 0]', "angle"),
            )
        ),
    ],
)
def test_refused(more, said):
    """What a rig cannot mean is blamed by its key."""
    text = load_rig("parallelogram-6bar").text
    head, tail = text.split("[[bench.mounts]]", 1)
    with pytest.raises(RigError, match=said):
        rig_from_text(head + more + "\n[[bench.mounts]]" + tail)
