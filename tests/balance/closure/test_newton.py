"""Newton's method on loops and driven coordinates, and continuation between two of their positions."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.closure.newton import LoopProgram, LoopSystem
from balance.errors import ClosureError
from balance.motion.driven_coordinates import Drive

from .. import models


def system_of(closure: Closure, joint: str) -> LoopSystem:
    """A mechanism driven by one joint."""
    drive = Drive.of_joints(closure.mechanism, (joint,))
    return LoopSystem(closure.mechanism, closure.engine, closure.home, closure.length, closure.scales, drive)


@pytest.fixture(scope="module")
def system() -> LoopSystem:
    """The four-bar driven by its crank."""
    closure = Closure(models.load("four-bar"))
    return system_of(closure, "A0")


def test_newton_closes_loops_and_drive(system: LoopSystem) -> None:
    """From one guess, cranks a few degrees apart: loops and drive to rounding; many samples at once find the same."""
    target, home = 1.0 + np.linspace(-0.3, 0.3, 50), system.mechanism.home
    states = np.array([system.newton(home, u) for u in target[:, None]])
    gaps = [np.abs(system.gaps(q, u)).max() for q, u in zip(states, target[:, None], strict=True)]
    assert max(gaps) < 1e-14
    program = LoopProgram(system.mechanism.tree, system.mechanism.loops, system.drive)
    together = program.closed(np.repeat(home[:, None], 50, axis=1), target[None], program.order(states.T))
    np.testing.assert_allclose(together.T, states, atol=1e-13)


def test_the_inverse_gives_the_rates(system: LoopSystem) -> None:
    """Rates per rate of the crank: those of the closed configurations differenced."""
    home, step = system.mechanism.home, 1e-5
    rates = system.rates_per_drive(home)[:, 0]
    q = [system.newton(home, np.array([1.0 + s])) for s in (-step, step)]
    np.testing.assert_allclose(rates, (q[1] - q[0]) / (2 * step), atol=1e-9)


def test_marching_goes_round_on_one_branch(system: LoopSystem) -> None:
    """From the crank at 1 rad to one turn further, in steps that the method chooses: back at the start."""
    q = system.continue_to(system.mechanism.home, np.array([1.0 + 2 * np.pi]), 0.0)
    np.testing.assert_allclose(q - system.mechanism.home, [2 * np.pi, -2 * np.pi, 0.0], atol=1e-12)


def test_marching_out_of_reach_says_how_far_it_got() -> None:
    """Driven by the rocker beyond its dead point: the asked and the reached position, the time and the branch."""
    closure = Closure(models.load("four-bar"))
    system = system_of(closure, "B0")
    with pytest.raises(
        ClosureError, match=r"at B0 = 0\.5 \(t = 0\.25 s\): it gets as far as B0 = 1\.29.*branch of 'home'"
    ):
        system.continue_to(closure.home, np.array([0.5]), 0.25)
