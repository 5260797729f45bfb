"""Torque against speed."""

import numpy as np
import pytest

from balance.drives.motors import Constant, DirectCurrent, Induction, MeasuredMotor

from .source import REFERENCE, RPM

INDUCTION = Induction(12.75, 0.315, 2.565, 1.380)
MOTORS = {
    "induction": INDUCTION,
    "mirrored": Induction(12.75, 0.315, 2.565, 1.380, mirrored=True),
    "fixed curve": Induction(9.0, 0.2, 2.0, 0.3, synchronous=90.0, slip_base=310.0),
    "dc": DirectCurrent(1.2, 300.0),
    "constant": Constant(3.0),
    "table": MeasuredMotor.through(np.array([-10.0, 0.0, 40.0, 80.0, 120.0]), np.array([5.0, 4.0, 3.5, 1.0, -2.0])),
}


@pytest.mark.parametrize(("slip", "torque"), REFERENCE["motor_curve"].items())
def test_the_source_s_curve(slip, torque):
    """M(s) to 1e-6, at s = 0 too, where the published form has 0/0."""
    assert INDUCTION.curve(float(slip)) == pytest.approx(torque, rel=1e-6)
    nominal = 276 * RPM
    assert INDUCTION.torque((1.0 - float(slip)) * nominal, nominal) == pytest.approx(torque, rel=1e-6)
    assert INDUCTION.torque(nominal, nominal) == 0.0


@pytest.mark.parametrize("motor", MOTORS.values(), ids=MOTORS)
def test_slope_is_the_derivative(motor):
    """dM/dn by central differences, below and above the nominal speed."""
    for speed in (3.0, 31.0, 77.0, 95.0, 118.0):
        h = 1e-5
        difference = (motor.torque(speed + h, 90.0) - motor.torque(speed - h, 90.0)) / (2 * h)
        assert motor.slope(speed, 90.0) == pytest.approx(difference, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("motor", MOTORS.values(), ids=MOTORS)
def test_arrays_and_numbers_agree(motor):
    """An array of speeds gives the torques of its numbers."""
    speeds = np.array([0.0, 20.0, 90.0, 140.0])
    np.testing.assert_array_equal(motor.torque(speeds, 90.0), [motor.torque(float(n), 90.0) for n in speeds])
    np.testing.assert_array_equal(motor.slope(speeds, 90.0), [motor.slope(float(n), 90.0) for n in speeds])


def test_mirrored_braking_mirrors_driving():
    """M(-s) = -M(s); the published formula does not do that."""
    mirrored = MOTORS["mirrored"]
    assert mirrored.curve(-0.2) == -mirrored.curve(0.2)
    assert INDUCTION.curve(-0.2) == pytest.approx(-5.276988, rel=1e-6)


def test_direct_current_between_stall_and_no_load():
    """Stall torque at standstill, zero at the no-load speed; half the voltage halves both."""
    dc = MOTORS["dc"]
    assert dc.torque(0.0, 300.0) == pytest.approx(1.2)
    assert dc.torque(300.0, 300.0) == 0.0
    assert dc.torque(0.0, 150.0) == pytest.approx(0.6)


def test_a_table_goes_through_its_points_and_knows_its_range():
    """The points are met; monotone between them; what lies outside is known as outside."""
    table = MOTORS["table"]
    np.testing.assert_allclose(table.torque(table.speeds, 0.0), table.torques)
    assert (np.diff(table.torque(np.linspace(-10.0, 120.0, 400), 0.0)) < 0.0).all()
    assert table.covers(np.array([0.0, 120.0]))
    assert not table.covers(np.array([0.0, 121.0]))
