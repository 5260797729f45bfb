"""Each fit shows what it claims to: a scaled torque, friction that a model lacks, a delay that is left out."""

from dataclasses import replace

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.identification import identify
from testbench.identification.diagnostics import SCALE_UNKNOWN, Explanation, scale_document

from . import arms

ARM = load_mechanism("two-joint-arm-a0")
FIRST, SECOND = "mcx[link_1] + 0.3 m[link_2]", "mcx[link_2]"


def explained(scale: tuple[float, float] = (1.0, 1.0), delay: float = 0.0) -> Explanation:
    """Of a simulated arm whose torques read ``scale`` times what they are."""
    record = arms.record(ARM, seed=3, delay=delay)
    louder = replace(record, torque=record.torque * scale)
    return Explanation(identify([louder], ARM, "ls", others=False))


@pytest.fixture(scope="module")
def explanation():
    """Of an arm as it is."""
    return explained()


def test_scale_between_joints():
    """A torque of the second joint that reads 15 % too much is found to, against the first joint's."""
    scale = explained((1.0, 1.15)).scale_between["J2 / J1"]
    assert scale.value == pytest.approx(1.15, abs=0.02)
    assert scale.interval()[0] < 1.15 < scale.interval()[1]


def test_a_common_scale_is_not_told(explanation):
    """Both torques 10 % too much: the joints agree with each other, every moment is 10 % too much, and that is said."""
    both = explained((1.1, 1.1))
    assert both.scale_between["J2 / J1"].value == pytest.approx(1.0, abs=0.02)
    for text in (FIRST, SECOND):
        alone = both.rows_alone[0].first_moments[text]
        assert alone.value == pytest.approx(1.1 * explanation.rows_alone[0].first_moments[text].value, rel=1e-6)
    assert both.result.tests.scale is None
    assert scale_document(both.result.tests.scale) == {"identifiable": False, "reason": SCALE_UNKNOWN}


def test_rows_alone(explanation):
    """The first joint's torque tells both moments; the second's only the second link's."""
    first, second = explanation.rows_alone
    assert first.first_moments[FIRST].value == pytest.approx(0.34912, rel=0.05)
    assert second.first_moments[FIRST] is None
    assert second.first_moments[SECOND].value == pytest.approx(0.11106, rel=0.05)


def test_friction_left_out_stays_unexplained(explanation):
    """Without dry friction, which this arm has, several times as much stays unexplained; by direction is no better."""
    fits = {fit.name: fit for fit in explanation.friction}
    used = fits["dry and viscous friction"].unexplained["J1"]
    assert fits["no friction"].unexplained["J1"] > 3 * used
    assert fits["dry and viscous friction, dry by direction"].unexplained["J1"] > 0.9 * used


def test_a_delay_left_out_costs():
    """Torques logged 15 ms early, taken for timely, lose first moment at high cut-offs."""
    late = explained(delay=-0.015)
    assert late.result.chosen.delay == pytest.approx(-0.015)
    used = late.friction[3].first_moments[FIRST].value
    highest = late.without_delay[-1].first_moments[FIRST].value
    assert used == pytest.approx(0.34912, rel=0.03)
    assert abs(highest - 0.34912) > abs(used - 0.34912)


def test_the_file_itself(explanation):
    """The file's parameters leave the friction and the drives that this arm has beyond them."""
    left = explanation.file_unexplained
    used = explanation.friction[3].unexplained
    assert all(left[joint] > used[joint] for joint in ("J1", "J2"))
    assert np.isfinite(list(left.values())).all()
