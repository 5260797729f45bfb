"""Start-up from standstill."""

from dataclasses import replace

import numpy as np
import pytest

from balance.drives import DriveError
from balance.drives.harmonic_balance import steady_rotation
from balance.drives.time_integration import by_harmonics, by_tolerance, solver_scatter, start_up

from .motor_kinds import constant
from .source import REFERENCE, RPM, machine


@pytest.mark.parametrize("speed", [276, 828])
def test_turn_by_turn_as_the_reference(speed):
    """Ends of eight turns to 1e-4 s, extremes to 0.02 rpm."""
    run = start_up(machine(speed), 8)
    for turn, row in zip(run.turns, REFERENCE["startup_as_printed"][str(speed)], strict=True):
        assert turn.end == pytest.approx(row["t_end_s"], abs=1e-4)
        assert turn.fastest / RPM == pytest.approx(row["n_max"], abs=0.02)
        assert turn.slowest / RPM == pytest.approx(row["n_min"], abs=0.02)


def test_steady_in_the_second_turn_holds_at_276_not_at_828():
    """The source's remark, and where it ends: at 828 the extremes are within 0.1 rpm after about eight turns."""
    settled = {}
    for speed in (276, 828):
        final = steady_rotation(machine(speed))
        settled[speed] = start_up(machine(speed), 10).settled(final.fastest[1], final.slowest[1], 0.1 * RPM)
    assert settled == {276: 2, 828: 8}


def test_energy_is_kept_without_motor_and_losses():
    """Dropped from rest with a torque just above nothing, kinetic plus potential energy grows by the motor's work."""
    m = replace(machine(276), motor=constant(8.0), inertias=())
    run = start_up(m, 2)
    kinetic = 0.5 * m.inertia(run.travel) * run.speed**2
    total = kinetic + m.reduced.potential(run.travel) - 8.0 * run.travel
    assert np.ptp(total) < 1e-7 * kinetic.max()


def test_motors_that_do_not_start_or_do_not_come_round_are_named():
    """Weaker than the weight at standstill; strong enough there, and too weak further on."""
    with pytest.raises(DriveError, match="does not start at 0 deg"):
        start_up(replace(machine(276), motor=constant(6.0)))
    with pytest.raises(DriveError, match="turns back at"):
        start_up(replace(machine(276), motor=constant(0.5)), 1, start=np.radians(190.0))


def test_loose_solvers_scatter_the_answer():
    """At 828 integrators at rtol 1e-3 and looser are off by more than a tenth, at 1e-6 by less than 1e-4 of it."""
    trials, truth = by_tolerance(machine(828), 12), steady_rotation(machine(828)).fluctuation()
    loose = [t for t in trials if t.setting in {"rtol 0.01", "rtol 0.001"}]
    tight = [t for t in trials if t.setting in {"rtol 1e-06", "rtol 1e-08"}]
    assert solver_scatter(loose, truth) > 0.1
    assert solver_scatter(tight, truth) < 1e-4


def test_harmonics_converge():
    """More harmonics, less error, down to rounding."""
    truth = steady_rotation(machine(828)).fluctuation()
    errors = [abs(t.fluctuation - truth) for t in by_harmonics(machine(828), (4, 8, 16, 32))]
    assert errors[0] > errors[1] > errors[2]
    assert errors[3] < 1e-12
