"""Motions: straight legs of limited jerk from rest to rest, polygons, samples of a file; wrong files are refused."""

import re
import warnings
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from balance import datasets
from balance.errors import CoarseSamples, DataError, ModelError
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion import Motion, Samples
from balance.motion.motion_files import load_motion, motion_from_table
from balance.units import G0

KEYS: dict[str, object] = {
    "driven": "platform",
    "start": ["0 m", "0.212 m"],
    "peak_acceleration": "3 g0",
    "ramp": 0.25,
    "rest": "0.15 s",
    "moves": [{"axis": "x", "to": ["+40 mm", "-40 mm", "0 mm"]}],
}
JOINTS: dict[str, object] = {
    "driven": "joints",
    "joints": ["J1", "J2"],
    "start": ["0.1 rad", "10 deg"],
    "peak_acceleration": "50 rad/s^2",
    "moves": [{"joint": "J2", "to": ["90 deg", "0 deg"]}, {"joint": "J1", "to": ["1 rad"]}],
}
RATE = 20_000.0


def motion(**changes: object) -> Motion:
    """The keys with changes; None takes a key out."""
    return motion_from_table({key: value for key, value in (KEYS | changes).items() if value is not None})


@pytest.mark.parametrize("ramp", [0.05, 0.25, 0.5])
@pytest.mark.parametrize("peak", [0.5, 3.0])
def test_peak_acceleration_and_distance_are_attained(peak: float, ramp: float) -> None:
    """Peak acceleration as named, ends as named, whatever the ramp."""
    moved = motion(peak_acceleration=f"{peak} g0", ramp=ramp).sample(RATE)
    x = moved.position[:, 0]
    assert np.abs(moved.acceleration).max() == pytest.approx(peak * G0, rel=1e-2 if ramp == 0.5 else 1e-12)
    assert (x.max(), x.min()) == (pytest.approx(0.04, abs=1e-12), pytest.approx(-0.04, abs=1e-12))
    np.testing.assert_allclose(moved.position[:, 1], 0.212, atol=1e-15)
    np.testing.assert_allclose(moved.position[[0, -1]], [[0.0, 0.212]] * 2, atol=1e-12)


def test_a_leg_takes_the_time_that_its_pulses_take() -> None:
    """Two pulses of T = sqrt(d / (a (1 - ramp))): the whole motion lasts its legs and rests."""
    legs = sum(2 * np.sqrt(d / (3 * G0 * 0.75)) for d in (0.04, 0.08, 0.04))
    assert motion().duration == pytest.approx(legs + 4 * 0.15)


@pytest.mark.parametrize("changes", [{}, {"moves": [{"polygon": "triangle", "width": "50 mm", "height": "40 mm"}]}])
def test_position_velocity_and_acceleration_fit_together(changes: dict[str, object]) -> None:
    """Each is the derivative of the one before, and all are continuous: steps of at most rate x interval."""
    moved = motion(**changes).sample(RATE)
    for values, rate in ((moved.position, moved.velocity), (moved.velocity, moved.acceleration)):
        np.testing.assert_allclose(
            np.diff(values, axis=0), (rate[1:] + rate[:-1]) / 2 / RATE, atol=2e-3 * np.abs(rate).max() / RATE
        )
    shortest = np.linalg.norm(np.diff(motion(**changes).waypoints, axis=0), axis=1).min()
    pulse = np.sqrt(shortest / (3 * G0 * 0.75))
    jerk = 3 * G0 / (0.25 * pulse)
    assert np.linalg.norm(np.diff(moved.acceleration, axis=0), axis=1).max() <= jerk / RATE * (1 + 1e-9)


def test_rest_is_rest() -> None:
    """Before the first leg, between legs and after the last nothing moves for the time named."""
    moved = motion().sample(RATE)
    still = ~np.any(np.abs(moved.velocity) > 1e-12, axis=1)
    assert still.sum() / RATE == pytest.approx(4 * 0.15, abs=10 / RATE)
    assert still[: int(0.15 * RATE)].all()
    assert still[-int(0.15 * RATE) :].all()
    assert not np.abs(moved.acceleration[still]).max() > 3 * G0 * 1e-2


def test_a_step_of_acceleration_is_a_ramp_of_zero() -> None:
    """ramp = 0: bang-bang, T = sqrt(d / a)."""
    stepped = motion(ramp=0)
    assert stepped.duration == pytest.approx(sum(2 * np.sqrt(d / (3 * G0)) for d in (0.04, 0.08, 0.04)) + 0.6, rel=1e-6)
    assert np.abs(stepped.sample(RATE).acceleration).max() == pytest.approx(3 * G0)


def test_triangle_is_isosceles_and_centred() -> None:
    """50 mm wide, 40 mm high, its box centred on the start; closed, and back to the start."""
    corners = motion(moves=[{"polygon": "triangle", "width": "50 mm", "height": "40 mm"}]).waypoints - [0.0, 0.212]
    expected = [[0, 0], [-0.025, -0.02], [0.025, -0.02], [0, 0.02], [-0.025, -0.02], [0, 0]]
    np.testing.assert_allclose(corners, expected, atol=1e-15)


def test_polygon_of_any_corners() -> None:
    """Corners in turn about the start, closed."""
    corners = motion(moves=[{"polygon": [["1 cm", "0 m"], ["0 m", "1 cm"], ["-1 cm", "0 m"]]}]).waypoints
    np.testing.assert_allclose(corners[1:5, 0], [0.01, 0.0, -0.01, 0.01])


def test_joints_in_degrees() -> None:
    """Joint motions are about their start, angles in any unit, one joint at a time."""
    moved = motion_from_table(JOINTS)
    assert moved.joints == ("J1", "J2")
    np.testing.assert_allclose(moved.waypoints[1], [0.1, np.deg2rad(100.0)])
    np.testing.assert_allclose(moved.waypoints[-1], [1.1, np.deg2rad(10.0)])
    assert np.abs(moved.sample(1000.0).acceleration).max() == pytest.approx(50.0)


def test_another_peak_acceleration_on_the_same_path() -> None:
    """Four times the acceleration takes half the time between rests."""
    slow, fast = motion(), motion().with_peak_acceleration(12 * G0)
    assert fast.duration - 0.6 == pytest.approx((slow.duration - 0.6) / 2)
    np.testing.assert_array_equal(fast.waypoints, slow.waypoints)
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(DataError, match=r"peak acceleration is .*: expected a positive one"):
            slow.with_peak_acceleration(wrong)
    left_out = motion(peak_acceleration=None)
    assert left_out.with_peak_acceleration(12 * G0).duration == fast.duration
    with pytest.raises(DataError, match="motion: peak_acceleration: missing: add it, or state that of each run"):
        left_out.sample(1000.0)


def test_samples_are_uniform() -> None:
    """Time is index over rate: no accumulated step."""
    moved = motion().sample(3000.0)
    np.testing.assert_array_equal(moved.time, np.arange(len(moved.time)) / 3000.0)
    assert moved.time[-1] >= motion().duration


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf"), 1e12])
def test_impossible_rates(rate: float) -> None:
    """No samples, or more than memory holds, are refused with the numbers."""
    with pytest.raises(DataError, match=r"Hz for .* s: expected fewer than"):
        motion().sample(rate)


def written(folder: Path, samples: Samples, names: tuple[str, ...]) -> Path:
    """A CSV of samples as a person would write it."""
    header = ",".join(["time (s)", *names])
    np.savetxt(folder / "path.csv", np.column_stack([samples.time, samples.position]), "%.17g", ",", header=header,
               comments="")  # fmt: skip
    return folder / "path.csv"


def test_samples_of_a_file_come_back(tmp_path: Path) -> None:
    """A sine written to a file and read: positions as written, rates by the spline to its order."""
    time = np.linspace(0.0, 1.0, 401)
    w = 2 * np.pi * np.array([1.0, 2.0])
    sine = 0.03 * np.sin(w * time[:, None])
    written(tmp_path, Samples(time, sine, sine, sine), ("x (m)", "y (m)"))
    (tmp_path / "path.toml").write_text('driven = "platform"\nsamples = "path.csv"\n', encoding="utf-8")
    read = load_motion(tmp_path / "path.toml")
    samples = read.sample(10.0)
    np.testing.assert_array_equal(samples.position, sine)
    for found, true, order in (
        (samples.velocity, 0.03 * w * np.cos(w * time[:, None]), 4),
        (samples.acceleration, -(w**2) * sine, 3),
    ):
        at_end = 10.0 * np.abs(true).max() * (w.max() / 400.0) ** order
        np.testing.assert_allclose(found, true, atol=at_end)
        np.testing.assert_allclose(found[8:-8], true[8:-8], atol=1e-3 * at_end)
    assert read.duration == 1.0
    leg, one = np.linalg.norm(w**2 * sine, axis=1).max(), np.abs(w**2 * sine).max()
    for stated in (leg, one, 1.015 * leg, 0.985 * one):
        assert read.with_peak_acceleration(stated) is read
    for stated in (1.03 * leg, 0.97 * one):
        both = rf"{stated:.4g} m/s2.*{one:.4g} m/s2 \(one coordinate\) and {leg:.4g} m/s2 .*leave it out, or correct it"
        with pytest.raises(DataError, match=both):
            read.with_peak_acceleration(stated)


@pytest.mark.parametrize(
    ("unit", "position", "is_coarse"),
    [
        (1e-3, lambda t: np.sin(6.0 * t), True),
        (2.0 * np.pi / 4096, lambda t: np.sin(6.0 * t), True),
        (1e-3, lambda t: 0.7 + 15.7 * t, True),
        (1e-3, lambda t: 0.01 * t, True),
        (1e-7, lambda t: np.sin(6.0 * t), False),
        (1e-15, lambda t: np.sin(6.0 * t), False),
        (1e-3, lambda t: 3.0 * t, False),
        (1e-3, lambda t: 0.0 * t, False),
    ],
    ids=["digits", "counts", "all gaps large", "slow", "more digits", "all digits", "whole steps", "rest"],
)
def test_steps_that_make_the_acceleration_are_told(tmp_path: Path, unit, position, is_coarse) -> None:
    """A second difference of values rounded to 1 mrad, 1 ms apart, is of 1000 rad/s2; smooth samples have none."""
    time = np.arange(500) * 1e-3
    rounded = np.round(position(time) / unit)[:, None] * unit
    written(tmp_path, Samples(time, rounded, rounded, rounded), ("A0 (rad)",))
    (tmp_path / "path.toml").write_text('driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8")
    said = load_motion(tmp_path / "path.toml").recorded.coarse
    assert len(said) == is_coarse
    if said:
        assert f"A0: the samples go in steps of {unit:.3g} rad, each of which makes {unit * 1e6:.3g} rad/s2" in said[0]


@pytest.mark.parametrize("position", [lambda t: 0.3 * np.sin(19.0 * t), lambda t: 40.0 * t], ids=["swing", "turn"])
@pytest.mark.parametrize("rate", [7200.0, 2048.0, 1000.0])
def test_an_erring_clock_is_told(tmp_path: Path, rate, position) -> None:
    """Instants rounded to 1 us make an acceleration of their own; true instants, uneven as they may be, do not.

    The rate that was meant is that of the samples, one that is 0.2 % more is not.
    """
    rng = np.random.default_rng(3)
    even = np.arange(2000) / rate
    uneven = even + 2e-6 * rng.standard_normal(2000)
    for true, stamps, wrong in [
        (even, np.round(even, 6), rate != 1000.0),
        (even, even, False),
        (uneven, uneven, False),
    ]:
        values = position(true)[:, None]
        written(tmp_path, Samples(stamps, values, values, values), ("A0 (rad)",))
        (tmp_path / "path.toml").write_text(
            'driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8"
        )
        said = load_motion(tmp_path / "path.toml").recorded.coarse
        assert len(said) == wrong
        for one in said:
            away = float(re.search("the instants of the samples are wrong by about ([0-9e.-]+) s", one)[1])
            assert away == pytest.approx(np.std(stamps - even), rel=0.5)
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            assert len(load_motion(tmp_path / "path.toml").sample_as_asked(rate).time) == 2000
        with pytest.raises(DataError, match="is not that of its samples"):
            load_motion(tmp_path / "path.toml").sample_as_asked(1.002 * rate)
        assert [one.category for one in heard] == [CoarseSamples] * wrong


ROUGH = {
    "noise": (lambda t, rng: 2e-5 * rng.standard_normal(len(t)), "the samples are rough: "),
    "noise on counts": (
        lambda t, rng: np.round((0.3 * np.sin(19.0 * t) + 4e-4 * rng.standard_normal(len(t))) / 3.8e-4) * 3.8e-4
        - 0.3 * np.sin(19.0 * t), "the samples are rough: ",
    ),
    "spike": (lambda t, rng: 1e-2 * (np.arange(len(t)) == 301), "one value does not fit, about 0.3"),
    "value twice": (lambda t, rng: np.where(np.arange(len(t)) == 301, -5.6e-3, 0.0), "one value does not fit"),
    "noise of a ninth": (lambda t, rng: 2e-6 * rng.standard_normal(len(t)), "the samples are rough: "),
    "single precision": (
        lambda t, rng: np.float32(100.0 + 0.3 * np.sin(19.0 * t)) - 0.3 * np.sin(19.0 * t), "the samples are rough: "
    ),
    "noise of a quarter": (
        lambda t, rng: 2e-5 * rng.standard_normal(len(t)) * (t < 0.25), r"samples are rough between 0\.0\d+ s and 0\.2",
    ),
    "noise of both ends": (
        lambda t, rng: 2e-6 * rng.standard_normal(len(t)) * (abs(t - 0.5) > 0.35),
        r"rough in 6 of 16 parts, between 0\.0\d+ s and 0\.99",
    ),
    "noise of every other 100 ms": (
        lambda t, rng: 2e-5 * rng.standard_normal(len(t)) * (t % 0.2 < 0.1), r"rough in \d+ of 16 parts, ",
    ),
    "four values": (
        lambda t, rng: 1e-2 * np.isin(np.arange(len(t)), (200, 301, 500, 800)),
        r"several values do not fit between 0\.\d+ s and 0\.80",
    ),
    "a value in 100": (lambda t, rng: 1e-3 * (np.arange(len(t)) % 100 == 50), "several values do not fit between 0.0"),
    **{
        f"jumps after {k} samples": (
            lambda t, rng, p=1e-3 * k: np.where(t % (2 * p) < p, 1e3, -1e3) * (t % p) * (p - t % p), None
        )
        for k in (6, 8, 10, 12, 20)
    },
    "little noise": (lambda t, rng: 3e-7 * rng.standard_normal(len(t)), None),
    "a move of 20 samples": (
        lambda t, rng: (lambda u: u**3 * (10.0 - 15.0 * u + 6.0 * u**2))(np.clip((t - 0.5) / 0.02, 0.0, 1.0)), None
    ),
    "100 Hz": (lambda t, rng: 1e-3 * np.sin(628.0 * t), None),
    "jumps": (lambda t, rng: 50.0 * np.where(t % 0.2 < 0.1, 1.0, -1.0) * (t % 0.1) * (0.1 - t % 0.1), None),
}  # fmt: skip


@pytest.mark.parametrize("case", ROUGH)
def test_rough_samples_are_told(tmp_path: Path, case) -> None:
    """Noise, with or without the steps of an encoder, and one wrong value make accelerations that no machine has."""
    error, message = ROUGH[case]
    time = np.arange(1000) * 1e-3
    values = (0.3 * np.sin(19.0 * time) + error(time, np.random.default_rng(2)))[:, None]
    written(tmp_path, Samples(time, values, values, values), ("A0 (rad)",))
    (tmp_path / "path.toml").write_text('driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8")
    said = load_motion(tmp_path / "path.toml").recorded.coarse
    assert len(said) == (message is not None)
    assert all(re.search(str(message), one) for one in said)


@pytest.mark.parametrize("end", [slice(49), slice(-49, None)])
def test_noise_is_told_as_well_at_the_end_as_at_the_beginning(tmp_path: Path, end) -> None:
    """Of 40 joints, each rough in 49 of 3054 samples: the last ones were in no part that noise is sought in."""
    names, time = [f"J{i}" for i in range(40)], np.arange(3054) * 1e-3
    values = np.tile(np.sin(6.28 * time)[:, None], 40)
    values[end] += 3e-6 * np.random.default_rng(1).standard_normal((49, 40))
    written(tmp_path, Samples(time, values, values, values), tuple(f"{name} (rad)" for name in names))
    (tmp_path / "path.toml").write_text(f'driven = "joints"\njoints = {names}\nsamples = "path.csv"\n', "utf-8")
    assert len(load_motion(tmp_path / "path.toml").recorded.coarse) == 40


def test_the_ends_are_as_good_as_the_middle(tmp_path: Path) -> None:
    """Noise of the first and last sample makes no more than twice the acceleration that it makes elsewhere."""
    names, time = [f"J{i}" for i in range(60)], np.arange(100) * 1e-3
    noise = 1e-6 * np.random.default_rng(4).standard_normal((100, 60))
    written(tmp_path, Samples(time, noise, noise, noise), tuple(f"{name} (rad)" for name in names))
    (tmp_path / "path.toml").write_text(
        f'driven = "joints"\njoints = {names}\nsamples = "path.csv"\n', encoding="utf-8"
    )
    size = np.sqrt(np.mean(load_motion(tmp_path / "path.toml").recorded.acceleration ** 2, axis=1))
    assert size.max() < 2.2 * np.median(size)  # 1.7, and 9 % of it for 60 draws


def test_a_gap_between_samples_is_told(tmp_path: Path) -> None:
    """Thirty rows are missing: what is laid through them is no record."""
    time = np.delete(np.arange(1000) * 1e-3, slice(299, 329))
    values = 0.3 * np.sin(19.0 * time)[:, None]
    written(tmp_path, Samples(time, values, values, values), ("A0 (rad)",))
    (tmp_path / "path.toml").write_text('driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8")
    assert "no sample between 0.298 s and 0.329 s" in load_motion(tmp_path / "path.toml").recorded.coarse[0]


def test_a_wrapped_angle_is_refused(tmp_path: Path) -> None:
    """From +pi to -pi in one sample: no mechanism does; lengths may go as far as they like."""
    time = np.arange(500) * 1e-3
    wrapped = np.remainder(40.0 * time + np.pi, 2.0 * np.pi)[:, None] - np.pi
    for column, refused in [("A0 (rad)", True), ("A0 (m)", False)]:
        written(tmp_path, Samples(time, wrapped, wrapped, wrapped), (column,))
        (tmp_path / "path.toml").write_text(
            'driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8"
        )
        if refused:
            with pytest.raises(DataError, match=r"path.csv, line 81: A0 goes from 3\.12 rad to -3\.123 rad: expected"):
                load_motion(tmp_path / "path.toml")
        else:
            load_motion(tmp_path / "path.toml")


FILES = {
    "no such file": (None, "no such file 'path.csv'"),
    "other columns": ("t,x\n0,1\n", r"path.csv: must hold the columns time \(s\), x \(m\), y \(m\)"),
    "words": ("time (s),x (m),y (m)\n" + "0,up,0\n" * 6, "path.csv, line 2: x is 'up': expected a number"),
    "empty": ("", "must hold the columns"),
    "too short": ("time (s),x (m),y (m)\n0,0,0\n1,1,1\n", "at least 6 rows with increasing time"),
    "backwards": (
        "time (s),x (m),y (m)\n" + "".join(f"{-i},0,0\n" for i in range(8)),
        "path.csv, line 3: time goes from 0 s to -1 s: expected increasing time",
    ),
    "gap": (
        "time (s),x (m),y (m)\n" + "".join(f"{i},{'nan' if i == 3 else 0},0\n" for i in range(8)),
        "line 5: x is 'nan'",
    ),
}


@pytest.mark.parametrize("case", FILES)
def test_wrong_files_of_samples(tmp_path: Path, case: str) -> None:
    """The motion file, the CSV and its expected content are named."""
    content, message = FILES[case]
    if content is not None:
        (tmp_path / "path.csv").write_text(content, encoding="utf-8")
    (tmp_path / "motion.toml").write_text('samples = "path.csv"\n', encoding="utf-8")
    with pytest.raises(DataError, match=rf"^motion\.toml: samples: .*{message}"):
        load_motion(tmp_path / "motion.toml")


WRONG = {
    "driven": ({"driven": "wheels"}, "driven: 'wheels': expected 'platform' or 'joints'"),
    "axes": ({"axes": ["x", "w"]}, r"axes\[1\]: 'w': expected 'x', 'y' or 'z'"),
    "axes twice": ({"axes": ["x", "x"]}, r"axes: \['x', 'x'\]: expected each once"),
    "start too long": ({"start": ["0 m"] * 3}, "start: has 3 values: expected one for each of x, y"),
    "acceleration zero": ({"peak_acceleration": "0 g0"}, "peak_acceleration: '0 g0': expected more than zero"),
    "ramp too long": ({"ramp": 0.6}, "ramp: 0.6: expected 0.5 or less"),
    "rest negative": ({"rest": "-1 s"}, "rest: '-1 s': expected zero or more"),
    "moves empty": ({"moves": []}, "moves: has 0 values: expected at least 1"),
    "move without end": ({"moves": [{"axis": "x"}]}, r"moves\[0\]\.to: missing: expected where each leg ends"),
    "move along z": ({"moves": [{"axis": "z", "to": ["1 mm"]}]}, r"moves\[0\]: axis: 'z': expected one of x, y"),
    "move nowhere": ({"moves": [{"axis": "x", "to": ["0 mm"]}]}, "nothing moves"),
    "polygon of a name": ({"moves": [{"polygon": "hexagon"}]}, r"moves\[0\]\.polygon: 'hexagon': expected 'triangle'"),
    "triangle without height": ({"moves": [{"polygon": "triangle", "width": "1 mm"}]}, "height: missing"),
    "flat polygon": ({"moves": [{"polygon": [["0 m", "0 m"]]}]}, r"moves\[0\]\.polygon: has 1 values"),
    "joint for a platform": ({"moves": [{"joint": "J1", "to": ["1 rad"]}]}, r"moves\[0\]: joint: .*: expected axis"),
    "samples and moves": ({"samples": "path.csv"}, "start: has no effect with samples"),
    "joints for a platform": ({"joints": ["J1"]}, "joints: has no effect with driven = 'platform'"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_every_wrong_value_is_named(case: str) -> None:
    """One message: the key, what it holds, what was expected."""
    changes, message = WRONG[case]
    with pytest.raises(DataError, match=message):
        motion(**changes)


WRONG_JOINTS = {
    "joints missing": ({"joints": None}, "joints: missing"),
    "joint twice": ({"joints": ["J1", "J1"]}, r"joints: \['J1', 'J1'\]: expected each once"),
    "point for joints": ({"point": "tip"}, "point: has no effect with driven = 'joints'"),
    "move of another": (
        {"moves": [{"joint": "J9", "to": ["1 rad"]}]},
        r"moves\[0\]: joint: 'J9': expected one of J1",
    ),
    "acceleration of a point": (
        {"peak_acceleration": "3 g0"},
        "is acceleration: expected angular acceleration",
    ),
    "triangle": (
        {"moves": [{"polygon": "triangle", "width": "1 m", "height": "1 m"}]},
        "is length: expected angle",
    ),
}


@pytest.mark.parametrize("case", WRONG_JOINTS)
def test_every_wrong_joint_value_is_named(case: str) -> None:
    """Joint motions are angles, of joints that are named."""
    changes, message = WRONG_JOINTS[case]
    with pytest.raises(DataError, match=message):
        motion_from_table({key: value for key, value in (JOINTS | changes).items() if value is not None})


def test_a_polygon_needs_two_coordinates() -> None:
    """A corner has two coordinates: a motion of one axis, or of three, has no polygon."""
    for axes in (["x"], ["x", "y", "z"]):
        with pytest.raises(DataError, match="polygon"):
            motion(
                axes=axes, start=["0 m"] * len(axes),
                moves=[{"polygon": "triangle", "width": "5 cm", "height": "4 cm"}],
            )  # fmt: skip


@pytest.mark.parametrize("name", datasets.dataset_names("motions", ".toml"))
def test_shipped_motions(name: str) -> None:
    """Each loads, and says where it is from or that it is assumed."""
    assert load_motion(name).duration > 0.5
    comment = (datasets.ROOT / "motions" / f"{name}.toml").read_text(encoding="utf-8").splitlines()[0]
    assert comment.startswith("#")
    assert "Source" in comment or "ssumed" in comment


def test_broken_toml_is_refused(tmp_path: Path) -> None:
    """The file is named; so is a file in another encoding."""
    (tmp_path / "a.toml").write_text("driven = platform", encoding="utf-8")
    with pytest.raises(DataError, match=r"^a\.toml: "):
        load_motion(tmp_path / "a.toml")
    (tmp_path / "b.toml").write_bytes('driven = "Gövde"'.encode("utf-16"))
    with pytest.raises(DataError, match=r"^b\.toml: "):
        load_motion(tmp_path / "b.toml")
    with pytest.raises(DataError, match="no such file"):
        load_motion("loop-the-loop")


def test_a_rate_that_steps_over_the_ramps_is_refused() -> None:
    """20 samples a second miss the pulses of a 3 g0 move: the rate that is needed is named."""
    with pytest.raises(DataError, match=r"20 Hz is too slow .* at least 188 Hz"):
        load_motion("x").sample(20.0)


def test_joints_are_driven_in_their_own_quantity():
    """Lengths for what slides, angles for what turns; the other way round is refused by name."""
    table = {"driven": "joints", "joints": ["J1"], "peak_acceleration": "3 m/s^2", "start": ["0 mm"]}
    motion = motion_from_table(table | {"moves": [{"joint": "J1", "to": ["40 mm"]}]})
    assert motion.sliding
    assert motion.sample(1000.0).position.max() == pytest.approx(0.04)
    with pytest.raises(ModelError, match="'J1' of serial-1r turns, but the motion gives lengths"):
        motion.sample(1000.0).drive(load_mechanism("serial-1r"))
    with pytest.raises(DataError, match="is angular acceleration: expected acceleration"):
        motion_from_table(table | {"peak_acceleration": "3 rad/s^2", "moves": [{"joint": "J1", "to": ["40 mm"]}]})


def test_joints_that_turn_and_that_slide_in_one_motion():
    """Each leg attains the peak acceleration of its own coordinate; one value for both kinds is refused."""
    motion = load_motion("scara-quill")
    samples = motion.sample(RATE)
    assert np.abs(samples.acceleration).max(axis=0) == pytest.approx([60.0, 60.0, G0, 60.0], rel=1e-9)
    assert motion.sliding == (False, False, True, False)
    with pytest.raises(DataError, match="one acceleration cannot be both"):
        motion.with_peak_acceleration(3.0)
    keys = JOINTS | {"start": ["0.1 rad", "10 mm"]}
    for peak, refusal in (("50 rad/s^2", "expected a list"), (["50 rad/s^2"], "has 1 values: expected one")):
        with pytest.raises(DataError, match=refusal):
            motion_from_table(keys | {"peak_acceleration": peak})


@pytest.mark.parametrize(("noise", "seed"), [*product([1.5e-7, 4e-7, 2e-6], range(3))])
def test_what_noise_makes_is_told_in_size(tmp_path: Path, noise, seed) -> None:
    """The share that is stated is the part of the acceleration that is not the motion's; of an RMS it is its square."""
    time, rng = np.arange(3000) * 1e-3, np.random.default_rng(seed)
    clean = 0.3 * np.sin(19.0 * time)[:, None] + 0.1 * np.cos(7.0 * time)[:, None]
    (tmp_path / "path.toml").write_text('driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8")
    made = []
    for values in (clean, clean + noise * rng.standard_normal(clean.shape)):
        written(tmp_path, Samples(time, values, values, values), ("A0 (rad)",))
        made.append(load_motion(tmp_path / "path.toml").recorded)
    true, rough = (one.acceleration for one in made)
    size = np.sqrt(np.mean(rough**2))
    share, more = 100.0 * np.sqrt(np.mean((rough - true) ** 2)) / size, 100.0 * (1.0 - np.sqrt(np.mean(true**2)) / size)
    if not made[1].coarse:
        assert share < 5.0  # 3 % are told, with the uncertainty of telling it
        return
    stated = re.search(
        r"wrong by about ([\d.]+) % of its RMS value from sample to sample, which adds ([\d.]+) %", made[1].coarse[0]
    )
    assert float(stated[1]) == pytest.approx(share, rel=0.35, abs=1.5)  # parts below 3 % are not counted in it
    assert float(stated[2]) == pytest.approx(more, rel=0.8, abs=0.1)
