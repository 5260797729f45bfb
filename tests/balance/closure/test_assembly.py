"""Closed configurations from starts far open, and the branches that a mechanism can be put together in."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.errors import ClosureError

from .. import models


def closed(text: str) -> Closure:
    """A mechanism's closure."""
    return Closure(models.model(text))


def test_the_branches_of_a_four_bar_are_the_cuts_of_two_circles() -> None:
    """With the crank as it stands, the coupler's end is on two circles: both cuts are found, A at the keyframe."""
    text = models.four_bar(0.25, 0.1, 0.26, 0.2, 1.0)
    found = closed(text).configurations()
    assert [one.branch for one in found] == ["A", "B"]
    a, b0 = 0.1 * np.exp(1j), 0.25
    span = b0 - a
    lift = np.arccos((0.26**2 + abs(span) ** 2 - 0.2**2) / (2 * 0.26 * abs(span)))
    for one, sign in zip(found, (1.0, -1.0), strict=True):
        b = a + 0.26 * span / abs(span) * np.exp(1j * sign * lift)
        assert np.exp(1j * one.q) == pytest.approx(
            np.exp(1j * np.array([1.0, np.angle(b - a) - 1.0, np.angle(b - b0)]))
        )
        assert one.residual < 1e-15


def test_a_keyframe_chooses_its_branch() -> None:
    """The crossed four-bar as home is A, and is where motions start."""
    text = models.four_bar(0.25, 0.1, 0.26, 0.2, 1.0)
    other = closed(text).configurations()[1].q
    again = closed(text.split("<keyframe>")[0] + models.key(other) + "</mujoco>")
    np.testing.assert_allclose(again.home, other, atol=1e-15)
    assert again.configurations()[0].branch == "A"


def five_bar(scale: float) -> str:
    """Two arms of two links that meet, all along x at zero."""
    arms = [
        models.link(
            models.link(f'<site name="{name}_end" pos="{scale} 0 0"/>', f"{name}_fore", place=f'pos="{scale} 0 0"'),
            name,
            place=f'pos="{at} 0 0"',
        )
        for name, at in (("left", 0.0), ("right", 0.8 * scale))
    ]
    return models.mjcf("".join(arms), '<equality><connect name="tip" site1="left_end" site2="right_end"/></equality>')


def test_loops_that_are_a_metre_open_are_closed() -> None:
    """From the file's zero configuration, 0.96 m open; what is answered says how far it is."""
    closure = closed(five_bar(1.2).replace('pos="0.96 0 0"', 'pos="0.96 0 0" euler="0 0 1.5"'))
    assert closure.mechanism.branch.startswith("zero configuration, closed ")
    found = closure.configurations()
    assert closure.dof == 2
    assert len(found) >= 2
    assert max(one.residual for one in found) < 1e-14


def test_a_singular_start_is_refused() -> None:
    """All bars along one line: branches meet there, and none is chosen for the user."""
    with pytest.raises(ClosureError, match="singular at 'zero configuration'"):
        closed(models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0).split("<keyframe>")[0] + "</mujoco>")


def test_a_drawing_with_rounded_positions_closes_to_its_rounding() -> None:
    """A planar linkage whose planes miss each other by 1e-7 m: as free as without, and the residual says so."""
    text = models.four_bar(0.25, 0.1, 0.26, 0.2, 1.0).replace('name="end" pos="0.2 0 0"', 'name="end" pos="0.2 0 1e-7"')
    closure = closed(text)
    assert closure.dof == 1
    assert closure.residual(closure.home[None])[0] == pytest.approx(1e-7)
    assert len(closure.states(8)) == 8
    with pytest.raises(ClosureError, match=r"stay .* m apart"):
        closed(text.replace("1e-7", "1e-4"))


def test_a_start_from_which_no_step_leads_is_not_chosen_for() -> None:
    """Both arms straight and 0.2 m short: the way out is either way, so only the list of branches is answered."""
    text = five_bar(1.2).replace('pos="0.96 0 0"', 'pos="0.2 0 0"')
    with pytest.raises(ClosureError, match="they close: balance assemble lists where"):
        closed(text)
    found = Closure(models.model(text), search=True).configurations()
    assert len(found) >= 2
    assert max(one.residual for one in found) < 1e-14


def test_a_motor_that_cannot_move_tells_no_branch() -> None:
    """A rigid triangle whose motor is held, and a wheel on it that turns freely: two ways, not one for each angle."""
    bars = models.link(models.link('<site name="end" pos="0.4 0 0"/>', "b", place='pos="0.3 0 0"'), "a")
    text = models.mjcf(
        bars + models.link("", "wheel") + '<site name="fixed" pos="0.25 0 0"/>',
        '<equality><connect name="pin" site1="end" site2="fixed"/></equality>'
        + models.motors("a")
        + models.key([1.2, -1.9, 0.3]),
    )
    found = closed(text).configurations()
    assert [one.branch for one in found] == ["A", "B"]
    assert len({round(float(one.q[2]), 9) for one in found}) == 1
