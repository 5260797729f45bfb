"""Identification through closed loops, from logs of the simulated bench: the known parameters lie in the intervals."""

from dataclasses import replace

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench.errors import AnalysisError
from testbench.identification import identify
from testbench.identification.records import assemble
from testbench.identification.result import validate
from testbench.store import open_campaign

from ..conftest import conditions

MECHANISM = load_mechanism("parallelogram-6bar")
PLAN = conditions((3.4116, 17.1105, ("triangle",)), (5.0, 17.1105, ("triangle",)), (3.4116, 10.0, ("y",)))


@pytest.fixture(scope="module")
def runs(shared):
    """Two triangles with two payloads, and a move along y with other counter-masses."""
    return open_campaign(shared(PLAN).campaign).runs


@pytest.fixture(scope="module")
def taken(runs):
    """Encoders and torques of the first two runs."""
    return assemble(memory.aligned(runs[:2], MECHANISM), "torque")


@pytest.fixture(scope="module")
def separate(runs):
    """Those of the third, as mounted in the first."""
    return assemble(memory.aligned([runs[0], runs[2]], MECHANISM), "torque").records[1:]


def inside(result) -> list[bool]:
    """Whether the known values of the base parameters lie in their intervals."""
    return [v.interval[0] <= v.in_file <= v.interval[1] for v in result.base_values()]


@pytest.fixture(scope="module")
def by_torque(taken):
    """From the motor torques of the first two runs."""
    return identify(taken.records, taken.mechanism, "ls", others=False)


def test_base_parameters_from_motor_torques(by_torque):
    """Encoders and torques of A0 and B0 determine what moves them as mounted in the first run, within intervals."""
    assert by_torque.rows == ("A0", "B0")
    assert len(by_torque.base_values()) == 8
    assert all(inside(by_torque))
    third = {value.name: value for value in by_torque.base_values()}["mcx[AC] + mcx[BD] + 0.15 m[platform]"]
    assert third.value == pytest.approx(0.53384, rel=0.01)


def test_weak_excitation_is_said(by_torque):
    """Strokes of a few centimetres hardly tell a weight from an offset of the torque: that is said before solving."""
    seen = by_torque.identified.identifiability
    assert by_torque.excitation == "poor"
    assert "offset[A0]" in seen.weakest
    assert by_torque.verdict == "doubtful"
    assert "poor_excitation" in {doubt.code for doubt in by_torque.doubts}


def test_known_masses_tell_the_scale(by_torque):
    """Two payloads that are known tell the scale of the torques: one, to a per cent."""
    scale = by_torque.tests.scale
    assert scale.interval()[0] < 1.0 < scale.interval()[1]
    assert scale.half_width() < 0.01


def test_a_wrong_scale_is_found(taken):
    """Torques that read 8 % too much are found to, by the payloads that are known."""
    louder = [replace(r, torque=1.08 * r.torque) for r in taken.records]
    scale = identify(louder, taken.mechanism, "ls", others=False).tests.scale
    assert scale.value == pytest.approx(1.08, abs=0.01)


@pytest.fixture(scope="module")
def first(runs):
    """The first run on one clock."""
    return memory.aligned(runs[:1], MECHANISM)


@pytest.fixture(scope="module")
def by_force(first):
    """Its force sensors."""
    return assemble(first, "wrench")


def test_force_sensors(by_force):
    """Forces alone, the base's motion taken out, determine the balance conditions, closer than torques do."""
    taken = by_force
    result = identify(taken.records, taken.mechanism)
    assert result.rows == ("Fx", "Fy")
    assert result.method == "ls"
    moments = result.first_moments()
    assert len(moments) == 4
    assert all(v.interval[1] - v.interval[0] < 0.02 for v in moments)
    for value in moments:
        assert value.value == pytest.approx(value.in_file, abs=0.003)
    assert any("base" in note for note in taken.notes)
    with pytest.raises(AnalysisError, match="expected ls"):
        identify(taken.records, taken.mechanism, "iv")


def test_both_together(first, by_torque):
    """Forces and torques, each weighted by its noise: inertias from torques, first moments as close as from forces."""
    taken = assemble(first, "both")
    result = identify(taken.records, taken.mechanism, "ls", others=False)
    assert result.rows == ("A0", "B0", "Fx", "Fy")
    values = {value.name: value for value in result.base_values()}
    moment = values["mcx[A0A] + 0.15 m[AC] + mcx[BD] + 0.15 m[platform]"]
    alone = {value.name: value for value in by_torque.base_values()}[moment.name]
    assert moment.interval[1] - moment.interval[0] < 0.2 * (alone.interval[1] - alone.interval[0])
    inertias = [value for name, value in values.items() if name.startswith("Izz")]
    assert len(inertias) == 2
    assert all(value.value == pytest.approx(value.in_file, rel=0.02) for value in inertias)


def test_a_separate_run_is_foretold(separate, by_torque):
    """A run with other counter-masses and another motion is foretold: less than 2 % of its torque stays unexplained."""
    held = validate(by_torque, separate)
    assert (held.rms_ratio_in_band < 0.02).all()
    assert held.doubts == []
    assert held.angles is None


def test_a_separate_run_with_an_unknown_mass_is_not(separate, by_torque):
    """Where the sheet forgot the counter-masses, the separate run is not foretold, and that is a doubt."""
    (record,) = separate
    forgotten = type(record)("forgotten", record.origin, record.grid, record.q, record.torque)
    held = validate(by_torque, [forgotten])
    assert (held.rms_ratio_in_band > 0.1).any()
    assert any("forgotten" in doubt.text for doubt in held.doubts)


def test_runs_identified_from_prove_nothing(taken, by_force, by_torque):
    """A run that was identified from is refused as a separate one; so are other sensors."""
    with pytest.raises(AnalysisError, match="identified from"):
        validate(by_torque, taken.records[:1])
    with pytest.raises(AnalysisError, match="measured Fx, Fy, expected A0, B0"):
        validate(by_torque, [replace(record, name="another") for record in by_force.records])


def test_what_other_runs_mounted_is_taken_off(taken, by_torque):
    """Two payloads in one solve leave little unexplained; taken for alike, they leave five times as much."""
    alike = [type(r)(r.name, r.origin, r.grid, r.q, r.torque) for r in taken.records]
    mixed = identify(alike, taken.mechanism, "ls", others=False)
    assert np.all(mixed.rms_ratio_in_band > 5 * by_torque.rms_ratio_in_band)
