"""The flywheel for a wanted fluctuation."""

import numpy as np
import pytest

from balance.drives import DriveError
from balance.drives.harmonic_balance import flywheel_estimate, flywheel_for, steady_rotation

from .source import REFERENCE, machine


@pytest.mark.parametrize("row", REFERENCE["flywheel"], ids=lambda row: f"{row['nm']}-{row['target']}")
def test_the_reference_s_flywheels(row):
    """Inertia on the crank's shaft to 2e-5; none where the fluctuation is small enough already."""
    wheel = flywheel_for(machine(row["nm"]), row["target"])
    assert wheel.inertia == pytest.approx(row["J_added"], rel=3e-5)
    assert wheel.fluctuation <= wheel.wanted + 1e-9


def test_a_flywheel_on_the_motor_s_shaft_is_smaller_by_the_ratio_squared():
    """J_motor = J_crank / ratio^2; the fluctuation is met either way."""
    crank, motor = (flywheel_for(machine(276), 0.1, side=side) for side in ("crank", "motor"))
    assert motor.inertia == pytest.approx(crank.inertia / 3.61**2, rel=1e-9)
    assert steady_rotation(machine(276).with_flywheel(motor.inertia, "motor")).fluctuation() == pytest.approx(
        0.1, rel=1e-9
    )


def test_the_textbook_s_estimate():
    """dE / (omega^2 delta) with the swing of weight's energy, 11.055 J."""
    row = REFERENCE["flywheel_estimate"]
    assert flywheel_estimate(machine(276), 0.1) == pytest.approx(row["I_needed_delta_0_1"], rel=1e-6)
    assert np.ptp(machine(276).reduced.potential(np.linspace(0, 7, 20001))) == pytest.approx(row["dE_pot"], rel=1e-6)


def test_nonsense_is_refused():
    """A fluctuation of zero needs an infinite flywheel."""
    with pytest.raises(DriveError, match="expected a number between"):
        flywheel_for(machine(276), 0.0)
