"""Torque against speed."""

import numpy as np
import pytest

from balance.drives.machine import Induction

from . import motor_kinds as motors
from .source import REFERENCE, RPM

SOURCE = {"kind": "induction", "peak_torque": "12.75 N m", "peak_slip": 0.315, "a": 2.565, "b": 1.380}
INDUCTION = Induction(**SOURCE, synchronous_speed="nominal")
MOTORS = {
    "induction": INDUCTION,
    "mirrored": Induction(**SOURCE, synchronous_speed="nominal", braking="mirrored"),
    "fixed curve": Induction(
        kind="induction",
        peak_torque="9 N m",
        peak_slip=0.2,
        a=2.0,
        b=0.3,
        synchronous_speed="90 rad/s",
        slip_base="310 rad/s",
    ),
    "dc": motors.dc(1.2, 300.0),
    "constant": motors.constant(3.0),
    "table": motors.measured([-10.0, 0.0, 40.0, 80.0, 120.0], [5.0, 4.0, 3.5, 1.0, -2.0]),
}


@pytest.mark.parametrize(("slip", "torque"), REFERENCE["motor_curve"].items())
def test_the_source_s_curve(slip, torque):
    """M(s) to 1e-6, at s = 0 too, where the published form has 0/0."""
    assert INDUCTION.curve(float(slip)) == pytest.approx(torque, rel=1e-6)
    nominal = 276 * RPM
    assert INDUCTION.torque_at((1.0 - float(slip)) * nominal, nominal) == pytest.approx(torque, rel=1e-6)
    assert INDUCTION.torque_at(nominal, nominal) == 0.0


@pytest.mark.parametrize("motor", MOTORS.values(), ids=MOTORS)
def test_slope_is_the_derivative(motor):
    """dM/dn by central differences, below and above the nominal speed."""
    for speed in (3.0, 31.0, 77.0, 95.0, 118.0):
        h = 1e-5
        difference = (motor.torque_at(speed + h, 90.0) - motor.torque_at(speed - h, 90.0)) / (2 * h)
        assert motor.slope_at(speed, 90.0) == pytest.approx(difference, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("motor", MOTORS.values(), ids=MOTORS)
def test_arrays_and_numbers_agree(motor):
    """An array of speeds gives the torques of its numbers."""
    speeds = np.array([0.0, 20.0, 90.0, 140.0])
    np.testing.assert_array_equal(motor.torque_at(speeds, 90.0), [motor.torque_at(float(n), 90.0) for n in speeds])
    np.testing.assert_array_equal(motor.slope_at(speeds, 90.0), [motor.slope_at(float(n), 90.0) for n in speeds])


def test_mirrored_braking_mirrors_driving():
    """M(-s) = -M(s); the published formula does not do that."""
    mirrored = MOTORS["mirrored"]
    assert mirrored.curve(-0.2) == -mirrored.curve(0.2)
    assert INDUCTION.curve(-0.2) == pytest.approx(-5.276988, rel=1e-6)


def test_direct_current_between_stall_and_no_load():
    """Stall torque at standstill, zero at the no-load speed; half the voltage halves both."""
    dc = MOTORS["dc"]
    assert dc.torque_at(0.0, 300.0) == pytest.approx(1.2)
    assert dc.torque_at(300.0, 300.0) == 0.0
    assert dc.torque_at(0.0, 150.0) == pytest.approx(0.6)


def test_a_table_goes_through_its_points_and_knows_its_range():
    """The points are met; monotone between them; what lies outside is known as outside."""
    table = MOTORS["table"]
    np.testing.assert_allclose(table.torque_at(np.array(table.speed), 0.0), table.torque)
    assert (np.diff(table.torque_at(np.linspace(-10.0, 120.0, 400), 0.0)) < 0.0).all()
    assert table.covers(np.array([0.0, 120.0]))
    assert not table.covers(np.array([0.0, 121.0]))
