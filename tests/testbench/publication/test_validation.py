"""Errors of predictions, and what the calibrated table says of the law's terms."""

import numpy as np
import pytest

from testbench.publication.forms import FORMS, forms
from testbench.publication.model import NAMES
from testbench.publication.validation import WAYS, groups, mean_error


@pytest.mark.parametrize(
    ("name", "held_out", "left_out"),
    [("constant", 13.8, 11.4), ("per axis", 12.3, 9.5), ("nearest acceleration", 11.0, 8.4)],
)
def test_baselines_err_as_known(printed, training, name, held_out, left_out):
    """The baselines' errors on 54 numbers, and with each payload left out, to the decimal."""
    asked = printed.without_payload(1.451)
    errors = [mean_error(WAYS[name](printed.without_payload(p)), printed.of_payload(p)) for p in printed.payloads]
    assert round(mean_error(WAYS[name](training), asked), 1) == held_out
    assert round(float(np.mean(errors)), 1) == left_out


def test_groups_find_where_it_fails(printed):
    """A group is told as failing where its errors have one sign and exceed the scatter, not where they scatter."""
    asked = printed.without_payload(1.451)
    wrong = asked.printed + 2.0 * (-1.0) ** np.arange(54) + 20.0 * ((asked.payload_kg == 5.0) & (asked.axis == "y"))
    first, *others = groups(asked, wrong, 4.0)
    assert (first.payload_kg, first.axis, first.count, first.fails) == (5.0, "y", 8, True)
    assert not any(group.fails for group in others)


def test_every_term_is_asked_for(training):
    """Leaving conditions out of the 1.45 kg table, no form does better than the whole law."""
    found = forms(training)
    assert len(found) == len(FORMS)
    assert found[0].parameters == NAMES
    assert all(form.left_out >= form.fitted for form in found)
