"""The base on its mounts obeys the laws of a linear body with six degrees of freedom."""

import numpy as np
import pytest

from balance.dynamics.moving_base import ElasticBase, displacement_at, skew
from balance.errors import DataError
from testbench.rig.bench import Bench

RATE = 10_000.0


def base() -> ElasticBase:
    """The default frame on four feet: no symmetry, all six degrees of freedom coupled."""
    return Bench().elastic()


def pulse(count: int, seed: int = 1) -> np.ndarray:
    """A smooth random wrench that begins and ends at zero, (count, 6) [N, N m]."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, count)[:, None]
    waves = sum(np.sin(2 * np.pi * (k * t + rng.random(6))) * rng.normal(size=6) for k in range(1, 6))
    return 100.0 * np.sin(np.pi * t) ** 2 * waves


def test_nothing_moves_nothing():
    """Zero wrench, zero motion, exactly."""
    moved = base().respond(np.zeros((1000, 6)), 1 / RATE)
    assert not np.any([moved.displacement, moved.velocity, moved.acceleration])


def test_static_limit():
    """Under a constant wrench the base comes to rest where the springs carry it."""
    body, wrench = base(), np.array([10.0, -20.0, 30.0, 1.0, 2.0, -3.0])
    moved = body.respond(np.tile(wrench, (200_000, 1)), 2e-4)
    assert moved.displacement[-1] == pytest.approx(np.linalg.solve(body.stiffness, wrench), rel=1e-9)
    assert np.abs(moved.velocity[-1]).max() < 1e-12


def test_inertial_limit():
    """In the first instant only inertia answers: a = M^-1 w."""
    body, wrench = base(), np.array([10.0, -20.0, 30.0, 1.0, 2.0, -3.0])
    moved = body.respond(np.tile(wrench, (2, 1)), 1e-6)
    assert moved.acceleration[0] == pytest.approx(np.linalg.solve(body.mass, wrench), rel=1e-12)


def test_resonance():
    """Each mode, driven at its own frequency, settles on the amplitude and phase of (K - w2 M + i w C)^-1."""
    body = base()
    for frequency in body.frequencies_hz:
        omega = 2 * np.pi * frequency
        wrench = np.array([3.0, -5.0, 2.0, 1.0, -0.7, 0.4])
        gain = np.linalg.solve(body.stiffness - omega**2 * body.mass + 1j * omega * body.damping, wrench)
        time = np.arange(40_000) / 5000.0
        moved = body.respond(np.sin(omega * time)[:, None] * wrench, 1 / 5000.0)
        late = time > 6.0
        expected = np.imag(gain * np.exp(1j * omega * time[late])[:, None])
        assert np.abs(moved.displacement[late] - expected).max() < 2e-4 * np.abs(gain).max()


def test_independent_integration():
    """An adaptive Runge-Kutta of eighth order on the same equation, with the wrench linear between samples, agrees."""
    from scipy.integrate import solve_ivp

    body, wrench = base(), pulse(200)
    time = np.arange(200) / 1000.0
    a, b = body.state_space()

    def rate(t, state):
        return a @ state + b @ np.array([np.interp(t, time, column) for column in wrench.T])

    found = solve_ivp(rate, (0, time[-1]), np.zeros(12), "DOP853", time, rtol=1e-10, atol=1e-14, max_step=1e-3)
    moved = body.respond(wrench, 1 / 1000.0)
    assert moved.displacement == pytest.approx(found.y[:6].T, abs=1e-7 * np.abs(moved.displacement).max())
    assert moved.velocity == pytest.approx(found.y[6:].T, abs=1e-7 * np.abs(moved.velocity).max())


def test_energy():
    """Work of the wrench = kinetic energy + elastic energy + what the dampers took."""
    body, wrench = base(), pulse(20_001)
    moved = body.respond(wrench, 1 / RATE)
    v, x = moved.velocity, moved.displacement
    power = np.einsum("ni,ni->n", wrench, v) - np.einsum("ni,ij,nj->n", v, body.damping, v)
    put_in = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / (2 * RATE))])
    stored = np.einsum("ni,ij,nj->n", v, body.mass, v) / 2 + np.einsum("ni,ij,nj->n", x, body.stiffness, x) / 2
    assert np.abs(stored - put_in).max() < 1e-4 * stored.max()


def test_reciprocity():
    """A force at P along p moves Q along q exactly as that force at Q along q moves P along p."""
    rng, body = np.random.default_rng(2), base()
    (point_p, point_q), (p, q) = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    push = pulse(3000)[:, :1]
    at_p, at_q = displacement_at(point_p).T @ p, displacement_at(point_q).T @ q
    from_p = body.respond(push * at_p, 1 / RATE).displacement @ at_q
    from_q = body.respond(push * at_q, 1 / RATE).displacement @ at_p
    assert from_p == pytest.approx(from_q, abs=1e-12 * np.abs(from_p).max())


def test_half_the_step():
    """A wrench that is linear between samples gives the same motion at any step: the solution is exact."""
    body, wrench = base(), pulse(500)
    fine = np.empty((999, 6))
    fine[::2], fine[1::2] = wrench, (wrench[1:] + wrench[:-1]) / 2
    coarse = body.respond(wrench, 1e-3).acceleration
    assert coarse == pytest.approx(body.respond(fine, 5e-4).acceleration[::2], abs=1e-10 * np.abs(coarse).max())


def test_acceleration_of_a_point():
    """A base that turns about z moves a point on x along y."""
    moved = base().respond(np.zeros((1, 6)), 1e-3)
    moved.acceleration[0] = [1.0, 0.0, 0.0, 0.0, 0.0, 2.0]
    assert moved.acceleration_at(np.array([0.5, 0.0, 0.0]))[0] == pytest.approx([1.0, 1.0, 0.0])


def test_own_inertia_is_about_the_centre():
    """A force through the centre of mass of a free base turns nothing."""
    body, bench = base(), Bench()
    force, centre = np.array([1.0, 2.0, 3.0]), np.array(bench.centre)
    found = np.linalg.solve(body.mass, np.concatenate([force, np.cross(centre, force)]))
    assert found[3:] == pytest.approx(np.zeros(3), abs=1e-15)
    assert found[:3] == pytest.approx(force / bench.mass)


def test_mounts_in_line():
    """Mounts in one line do not hold the base, and it is said."""
    text = {"stiffness": "1 kN/m", "damping": "1 N s/m"}
    mounts = [{"position": [f"{x} m", "0 m", "0 m"], **text} for x in (0, 1, 2)]
    with pytest.raises(DataError, match=r"bench\.mounts"):
        Bench.model_validate({"mounts": mounts}).elastic()


def test_skew():
    """S(a) b = a x b."""
    a, b = np.array([1.0, -2.0, 3.0]), np.array([0.5, 4.0, -1.0])
    assert skew(a) @ b == pytest.approx(np.cross(a, b))
