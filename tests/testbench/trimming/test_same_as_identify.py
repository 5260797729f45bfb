"""One simulated run through ``identify`` and through ``trim``: the same first moments, each by its own front half."""

import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench.identification import identify
from testbench.identification.records import assemble
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
