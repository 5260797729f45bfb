"""Whole trajectories: closed at every sample, on one branch, rates and second rates those of the path."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.errors import ClosureError
from balance.motion import Samples
from balance.motion.motion_files import load_motion

from .. import models

Swept = tuple[Closure, tuple[str, ...], list[float], str, Callable[..., Floats]]
"""A mechanism, joints driven together, their rates, and another coordinate as a closed form of them."""


def smooth(joints: tuple[str, ...], start: list[float], travel: list[float], count: int = 4001) -> Samples:
    """Sine sweeps of the driven joints about their start, over 1 s, phases apart."""
    time = np.linspace(0.0, 1.0, count)[:, None]
    phase, w = np.arange(len(joints)) * 0.7, 2 * np.pi * np.arange(1, len(joints) + 1)
    offset = np.asarray(start) - np.asarray(travel) * np.sin(phase)
    position = offset + np.asarray(travel) * np.sin(w * time + phase)
    velocity = np.asarray(travel) * w * np.cos(w * time + phase)
    return Samples(time[:, 0], position, velocity, -(w**2) * (position - offset), joints=joints)


def turn(joint: str, start: float, angle: float, count: int) -> Samples:
    """A joint that turns at 1 rad/s."""
    u = np.linspace(start, start + angle, count)
    return Samples(np.abs(u - start), u[:, None], np.full((count, 1), np.sign(angle)), np.zeros((count, 1)), (joint,))


SWEEPS: dict[str, Callable[[], tuple[str, Samples]]] = {
    "four-bar": lambda: (models.load("four-bar").text, smooth(("A0",), [1.0], [2.5])),
    "parallelogram-6bar": lambda: (
        models.load("parallelogram-6bar").text, smooth(("A0", "B0"), [2.356, 0.785], [0.4, 0.5])
    ),
    "parallelogram-6bar-full": lambda: (
        models.load("parallelogram-6bar-full").text, smooth(("A0", "B0"), [2.356, 0.785], [0.4, 0.3])
    ),
    "spatial four-bar": lambda: (models.spatial_four_bar(), smooth(("crank",), [0.8868958594656499], [0.6])),
    "Bennett": lambda: (models.bennett(), smooth(("j1",), [0.8], [0.9])),
}  # fmt: skip


@pytest.fixture(scope="module", params=SWEEPS)
def swept(request: pytest.FixtureRequest) -> tuple[Closure, Samples, Trajectory]:
    """A mechanism, a motion of its driven joints, and the trajectory that follows it."""
    text, samples = SWEEPS[request.param]()
    closure = Closure(models.model(text))
    return closure, samples, closure.follow(samples)


def test_every_row_stays_closed(swept: tuple[Closure, Samples, Trajectory]) -> None:
    """All loop rows, the redundant ones too, close to rounding at every sample, and the report says so."""
    closure, samples, trajectory = swept
    assert max(closure.residual(trajectory.q).max(), trajectory.residual) < 1e-13
    assert trajectory.is_closed()
    assert not trajectory.is_closed(0.0)
    assert trajectory.branch == "home"
    driven = [closure.mechanism.coordinate_index(joint) for joint in samples.joints]
    np.testing.assert_allclose(trajectory.q[:, driven], samples.position, atol=1e-13)


def test_rates_are_those_of_the_path(swept: tuple[Closure, Samples, Trajectory]) -> None:
    """v is the derivative of q and a that of v: central differences, to their second order."""
    _, samples, trajectory = swept
    for values, rate in ((trajectory.q, trajectory.v), (trajectory.v, trajectory.a)):
        difference = np.gradient(values, samples.time, axis=0)[1:-1]
        np.testing.assert_allclose(rate[1:-1], difference, atol=2e-4 * np.abs(rate).max())


def test_rates_per_drive_give_the_rates(swept: tuple[Closure, Samples, Trajectory]) -> None:
    """v = per_drive @ driven rates at every sample."""
    _, samples, trajectory = swept
    v = (trajectory.per_drive @ samples.velocity[:, :, None])[:, :, 0]
    np.testing.assert_allclose(v, trajectory.v, atol=1e-10 * np.abs(v).max())


def test_blocks_do_not_show() -> None:
    """A trajectory longer than a block, sampled anew at every third instant, is the same at those instants."""
    closure = Closure(models.load("parallelogram-6bar"))
    fine = smooth(("A0", "B0"), [2.356, 0.785], [0.4, 0.5], 3 * 4096 + 1)
    coarse = Samples(*(x[::3] for x in (fine.time, fine.position, fine.velocity, fine.acceleration)), fine.joints)
    one, other = closure.follow(fine), closure.follow(coarse)
    assert np.abs(one.q[::3] - other.q).max() < 1e-13
    assert np.abs(one.a[::3] - other.a).max() < 1e-10 * np.abs(one.a).max()


def test_the_home_keyframe_chooses_the_branch() -> None:
    """The crossed four-bar stays crossed for a whole turn of its crank, the open one open."""
    text = models.load("four-bar").text
    crossed_text = text.replace("-0.5542843118878877 1.376430622392165", "-2.38 -2.27")
    for sign, branch in ((1.0, text), (-1.0, crossed_text)):
        closure = Closure(models.model(branch))
        trajectory = closure.follow(turn("A0", closure.home[0], 2 * np.pi, 500))
        a = 0.1 * np.exp(1j * trajectory.q[:, 0])
        b = 0.25 + 0.2 * np.exp(1j * trajectory.q[:, 2])
        assert (sign * ((b - a) * np.conj(0.25 - a)).imag > 0.0).all()


def test_a_crank_may_turn_many_times() -> None:
    """After 20 turns the rocker is where it was, the coupler's angle has wound with the crank."""
    closure = Closure(models.load("four-bar"))
    trajectory = closure.follow(turn("A0", closure.home[0], 40 * np.pi, 8001))
    np.testing.assert_allclose(trajectory.q[-1] - trajectory.q[0], [40 * np.pi, -40 * np.pi, 0.0], atol=1e-9)
    assert trajectory.residual < 1e-12


def test_coarse_samples_stay_on_the_branch() -> None:
    """Samples half a radian apart are reached by smaller steps between them: same branch, same answer as fine ones."""
    closure = Closure(models.load("four-bar"))
    coarse = closure.follow(turn("A0", closure.home[0], -6 * np.pi, 37))
    fine = closure.follow(turn("A0", closure.home[0], -6 * np.pi, 36 * 40 + 1))
    np.testing.assert_allclose(coarse.q, fine.q[::40], atol=1e-11)


def test_a_motion_may_start_far_from_home() -> None:
    """The first sample is reached from the keyframe on its branch, two turns on."""
    closure = Closure(models.load("four-bar"))
    trajectory = closure.follow(turn("A0", closure.home[0] + 4 * np.pi, 0.1, 5))
    np.testing.assert_allclose(trajectory.q[0] - closure.home, [4 * np.pi, -4 * np.pi, 0.0], atol=1e-10)


def slider_crank(crank: float, rod: float, driven: str, sign: float = 1.0, slider_first: bool = False) -> Swept:
    """A slider-crank of ``crank`` and ``rod`` [m], driven along its ``slide`` or by its ``crank``."""
    closure, length = Closure(models.model(models.slider_crank(crank, rod, sign, slider_first))), crank + rod
    if driven == "crank":
        return (
            closure,
            ("crank",),
            [1.0],
            "slide",
            lambda u: crank * np.cos(u) + np.sqrt(rod**2 - (crank * np.sin(u)) ** 2),
        )
    return (
        closure,
        ("slide",),
        [length],
        "crank",
        lambda x: sign * np.arccos((crank**2 + x**2 - rod**2) / (2 * crank * x)),
    )


def cubic(m: float) -> Swept:
    """A joint that follows another's t as t^3 - 3 m^2 t: back between -m and m, so that outer branches look alike."""
    tie = f'<equality><joint name="tie" joint1="first" joint2="second" polycoef="0 {-3 * m**2} 0 1 0"/></equality>'
    home = models.key([-0.008 + 0.6 * m**2, -0.2])
    text = models.mjcf(models.link("", "first") + models.link("", "second"), tie + models.motors("first") + home)

    def lowest(u: Floats) -> Floats:
        x = -u / (2 * m**3)
        return np.where(x < -1.0, np.nan, -2 * m * np.cosh(np.arccosh(x + 0j) / 3).real)

    return Closure(models.model(text)), ("first",), [1.0], "second", lowest


def five_bar(left: float, right: float) -> Swept:
    """The shipped five-bar, its cranks driven at these rates: C is the one of two points at 0.32 m of both elbows."""

    def rod(left_crank: Floats, right_crank: Floats) -> Floats:
        elbow = -0.125 + 0.22 * np.exp(1j * left_crank)
        half = (0.125 + 0.22 * np.exp(1j * right_crank) - elbow) / 2
        return np.angle(half) + np.arccos(np.abs(half) / 0.32) - left_crank

    return Closure(models.load("five-bar")), ("A_left", "A_right"), [left, right], "B_left", rod


def spatial(driven: str) -> Swept:
    """The spatial four-bar: the ball on the rocker is 0.5 m from the universal joint on the crank."""
    closure = Closure(models.model(models.spatial_four_bar()))
    crank = [np.array([0.12, 0.0, 0.03]), np.array([0.0, 0.6, 0.8]), np.zeros(3)]
    rocker = [np.array([0.3, 0.0, 0.05]), np.array([0.28, 0.0, 0.96]), np.array([0.4, 0.0, 0.1])]
    (arm, axis, origin), other = (crank, rocker) if driven == "crank" else (rocker, crank)
    free = "rocker" if driven == "crank" else "crank"

    def both(u: Floats) -> Floats:
        end = origin + Rotation.from_rotvec(np.outer(u, axis)).apply(arm)
        along, across = other[0] - (other[0] @ other[1]) * other[1], np.cross(other[1], other[0])
        gap = other[2] + other[0] - along - end  # the distance squared is that of gap + along cos + across sin
        a, b = 2 * gap @ along, 2 * gap @ across
        half = np.arccos((0.25 - (gap**2).sum(1) - along @ along) / np.hypot(a, b))
        return np.arctan2(b, a) + np.array([[1.0], [-1.0]]) * half

    home = [closure.home[closure.mechanism.coordinate_index(name)] for name in (driven, free)]
    branch = np.cos(both(np.array(home[:1])) - home[1]).argmax()
    return closure, (driven,), [1.0], free, lambda u: both(u)[branch]


DEAD_CENTRES: dict[str, Callable[[], Swept]] = {
    "slide, crank up": lambda: slider_crank(0.05, 0.2, "slide"),
    "slide, crank down, first in the file": lambda: slider_crank(0.05, 0.2, "slide", -1.0, True),
    "slide, in thousandths of a metre": lambda: slider_crank(50.0, 200.0, "slide"),
    "slide, in kilometres": lambda: slider_crank(5e-5, 6e-5, "slide", -1.0),
    "crank longer than its rod": lambda: slider_crank(0.05, 0.045, "crank"),
    "five-bar, one crank": lambda: five_bar(1.0, 0.0),
    "five-bar, both cranks": lambda: five_bar(-0.6, 0.8),
    "cubic": lambda: cubic(0.0577),
    "spatial four-bar, crank": lambda: spatial("crank"),
    "spatial four-bar, rocker": lambda: spatial("rocker"),
}  # fmt: skip


@pytest.mark.parametrize("name", DEAD_CENTRES)
def test_only_a_singular_position_ends_a_branch(name: str) -> None:
    """Sweeps between 98 % of the ways to both dead centres, from any home and of any count of samples: the closed form.

    Beyond a dead centre, by 0.01 % or by far, nothing closes: refused there.
    """
    closure, joints, direction, coordinate, truth = DEAD_CENTRES[name]()
    driven = [closure.mechanism.coordinate_index(joint) for joint in joints]
    k, home = closure.mechanism.coordinate_index(coordinate), closure.home[driven]

    def at(s: Floats) -> Floats:
        return home + s[:, None] * np.array(direction)

    def sweep(closure: Closure, s: Floats) -> Floats:
        u = at(s)
        return closure.follow(Samples(np.arange(len(s)), u, 0 * u, 0 * u, joints)).q

    with np.errstate(invalid="ignore"):
        ways = np.outer([-1.0, 1.0], np.linspace(0.0, 4.0, 100_001))
        lost = np.isnan([truth(*at(way).T) for way in ways])
    ends = [way[open_.argmax()] if open_.any() else way[-1] for way, open_ in zip(ways, lost, strict=True)]
    for share in (0.01, 0.5, 0.99):
        start = share * ends[0] + (1 - share) * ends[1]
        there = Closure(replace(closure.mechanism, home=sweep(closure, np.array([0.0, start]))[-1]))
        for count in (2, 5, 200):
            s = np.r_[start, 0.98 * np.linspace(*ends, count), 0.98 * np.linspace(*ends[::-1], count)]
            off = sweep(there, s)[:, k] - truth(*at(s).T)
            np.testing.assert_allclose(np.exp(1j * off), 1.0, atol=1e-12)
    for end in np.array(ends)[lost.any(axis=1)]:
        for beyond, count in ((1.0002, 2), (1.3, 2), (1.3, 200)):
            with pytest.raises(ClosureError, match=r"as far as .* singular there"):
                sweep(closure, np.linspace(0.0, beyond * end, count))


def test_beyond_a_dead_point_is_out_of_reach() -> None:
    """A rocker driven past the point where crank and coupler are in line: refused, with time and how far it got."""
    closure = Closure(models.model(models.four_bar(0.25, 0.1, 0.26, 0.2, 1.0, driven="rocker"), "rocker-driven"))
    stretched = np.pi - np.arccos(
        (0.25**2 + 0.2**2 - (0.26 + 0.1) ** 2) / (2 * 0.25 * 0.2)
    )  # crank and coupler in line
    with pytest.raises(ClosureError, match=r"rocker-driven cannot be closed at rocker = .* \(t = .* s\)") as caught:
        closure.follow(turn("rocker", closure.home[2], -0.6, 200))
    assert f"as far as rocker = {stretched:.3f}" in str(caught.value)


def test_an_arm_stretched_beyond_its_reach_is_refused() -> None:
    """The tip of a 2R arm of 0.55 m sent to 0.7 m: refused with the position it reached on the way."""
    closure = Closure(models.load("serial-2r"))
    x = np.linspace(0.4, 0.7, 100)
    position = np.stack([x, 0 * x], axis=1)
    samples = Samples(x, position, np.ones_like(position), 0 * position, point="tip")
    with pytest.raises(
        ClosureError, match=r"as far as tip\.x = 0\.55,.*singular there: with tip\.x, tip\.y held, J2, J1 can move"
    ):
        closure.follow(samples)


def test_an_arm_stretched_is_singular() -> None:
    """Fully extended, the tip's position does not determine the joints: refused as singular or out of reach."""
    closure = Closure(models.load("serial-2r"))
    position = np.array([[0.4, 0.0], [0.5, 0.0], [0.55, 0.0]])
    samples = Samples(np.arange(3.0), position, 0 * position, 0 * position, point="tip")
    with pytest.raises(ClosureError, match="singular"):
        closure.follow(samples)


def test_a_parallelogram_laid_flat_is_singular() -> None:
    """A parallelogram four-bar at its change point, sampled exactly: refused with the time."""
    closure = Closure(models.model(models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0)))
    with pytest.raises(ClosureError, match=r"\(t = 2\.14159 s\).* singular"):
        closure.follow(turn("crank", 1.0, np.pi - 1.0, 201))


@pytest.mark.parametrize("count", [777, 1000, 1001])
def test_a_parallelogram_does_not_pass_its_change_point(count: int) -> None:
    """Where parallelogram and antiparallelogram meet, no sample need be singular: refused all the same."""
    closure = Closure(models.model(models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0)))
    with pytest.raises(
        ClosureError, match=r"as far as crank = 3\.14159.* singular there: with crank held, .*rocker.* can move"
    ):
        closure.follow(turn("crank", 1.0, 3.5, count))


def test_the_side_links_laid_flat_are_singular() -> None:
    """The complete manipulator's side links lie in one line where an arm points along the base: refused."""
    closure = Closure(models.load("parallelogram-6bar-full"))
    with pytest.raises(ClosureError, match="singular there: with A0, B0 held"):
        closure.follow(smooth(("A0", "B0"), [2.356, 0.785], [0.4, 0.5]))


@pytest.mark.parametrize("name", models.MANIPULATORS)
@pytest.mark.parametrize("motion", ["x", "y", "triangle"])
def test_shipped_motions_close_both_manipulators(name: str, motion: str) -> None:
    """The platform goes where the motion sends it, without turning, well apart from singular states."""
    mechanism = models.load(name)
    samples = load_motion(motion).sample(1000.0)
    trajectory = Closure(mechanism).follow(samples)
    q = dict(zip(mechanism.coordinates, trajectory.q.T, strict=True))
    theta2 = q["A0"] + q["A"]
    path = 0.15 * (np.exp(1j * q["A0"]) + np.exp(1j * theta2))
    np.testing.assert_allclose(path, samples.position[:, 0] + 1j * samples.position[:, 1], atol=1e-13)
    np.testing.assert_allclose(q["B0"], theta2, atol=1e-12)
    assert trajectory.condition < 1e4


def test_a_point_that_does_not_determine_the_mechanism_is_singular() -> None:
    """The centre of the first link of a 2R arm driven in the plane: refused at the first instant, by name."""
    closure = Closure(models.load("serial-2r"))
    position = np.array([[0.14 * np.cos(0.5), 0.14 * np.sin(0.5)]])
    samples = Samples(np.zeros(1), position, 0 * position, 0 * position, point="link_1")
    with pytest.raises(ClosureError, match=r"\(t = 0 s\).*singular there: with link_1\.x, link_1\.y held, J2 can move"):
        closure.follow(samples)


def test_from_a_trajectory_near_by():
    """A trajectory close by gives the same as continuation; one far off is refused."""
    mechanism = models.load("parallelogram-6bar")
    closure = Closure(mechanism)
    time = np.linspace(0.0, 1.0, 60)
    home = [closure.home[mechanism.coordinate_index(joint)] for joint in mechanism.driven]
    wave = 0.1 * np.sin(2.0 * np.pi * time)[:, None] * np.ones((1, 2))
    samples = [Samples(time, home + wave + more, wave, wave, mechanism.driven) for more in (0.0, 1e-3, 0.5)]
    first = closure.follow(samples[0])
    alone, near = closure.follow(samples[1]), closure.follow(samples[1], near=first)
    for name in ("q", "v", "a", "per_drive"):
        assert getattr(near, name) == pytest.approx(getattr(alone, name), abs=1e-9)
    assert near.is_closed()
    with pytest.raises(ClosureError):
        closure.follow(samples[2], near=first)
