"""One simulated run through ``identify`` and through ``trim``: the same first moments, each by its own front half."""

from dataclasses import replace

import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.identification import identify
from testbench.identification.records import UNSEEN_CODE, assemble
from testbench.rig.bench import Bench
from testbench.trimming import trim_runs

from . import linkages


@pytest.fixture(scope="module")
def runs():
    """A run without noise of an arm with two joints."""
    arm = load_mechanism("serial-2r")
    return memory.aligned([linkages.exact_run(arm)], arm)


@pytest.mark.parametrize("source", ["wrench", "torque"])
def test_first_moments_are_equal(runs, source):
    """Cut-offs, blocks and nuisances differ; with nothing but the motion in the record they may change nothing."""
    taken = assemble(runs, source)
    identified = identify(taken.records, taken.mechanism, "ls", others=False).first_moments()
    trimmed = dict(trim_runs(runs, source=source).values)
    assert {value.name for value in identified} == set(trimmed)
    for one in identified:
        assert trimmed[one.name].value == pytest.approx(one.value, abs=1e-9)
        assert one.value == pytest.approx(one.in_file, abs=1e-6)


SPRUNG = Bench.model_validate(
    {
        "coupling": "moving",
        "mass": "12 kg",
        "inertia": ["0.6 kg m^2"] * 3,
        "mounts": [
            {"position": [f"{x} m", f"{y} m", "0 m"], "stiffness": ["2e4 N/m"] * 3, "damping": ["40 N s/m"] * 3}
            for x, y in ((-0.2, -0.1), (0.2, -0.1), (0.0, 0.2))
        ],
    }
)
"""Of a light base on springs."""


def sprung_run(**sensors):
    """A run on a base that moves as the first joint does, torques by MuJoCo, its rig stating SPRUNG."""
    arm = load_mechanism("serial-2r")
    run = linkages.run(arm, plate=False, seconds=8.0, amplitude=0.6, **sensors)
    rig = rigs.rig_from_text(run.rig).model_copy(update={"bench": SPRUNG})
    return memory.aligned([run], arm, rig)


def test_a_base_that_moves_is_in_the_model_of_the_torques():
    """Within 4 standard errors of what the torques were made with; taken for still, far away, the inertias by 10 %."""
    taken = assemble(sprung_run(shaken=True), "torque")
    assert not taken.findings
    found = identify(taken.records, taken.mechanism, "ls", others=False)
    assert found.verdict == "usable up to a torque scale"
    for one in found.base_values():
        assert abs(one.value - one.in_file) < 4.0 * one.estimate.standard_uncertainty
    still = [replace(record, root=None) for record in taken.records]
    taken_for_still = identify(still, taken.mechanism, "ls", others=False)
    wrong = next(one for one in taken_for_still.base_values() if one.name.startswith("Izz[link_1]"))
    assert abs(wrong.value / wrong.in_file - 1.0) > 0.1


def test_a_base_that_moves_unseen_is_a_doubt():
    """The rig states springs, and no accelerometer is on the base."""
    (finding,) = assemble(sprung_run(), "torque").findings
    assert finding.code == UNSEEN_CODE
    assert "attached_to" in finding.message


def test_an_inertia_is_not_told_from_the_drives():
    """Of an arm whose file states no armature, as the row of both is listed."""
    run = memory.aligned([linkages.exact_run(load_mechanism("serial-2r"))], load_mechanism("serial-2r"))
    taken = assemble(run, "torque")
    (text,) = identify(taken.records, taken.mechanism, "ls", others=False).inseparable.values()
    assert "separates Izz[link_1] + 0.09 m[link_2] from armature[J1]" in text
