"""The printed numbers with their mechanics, computed once."""

import pytest

from studies.kiper2019.model import cases
from testbench import campaign_plan
from testbench.published_tables import load_published


@pytest.fixture(scope="session")
def printed():
    """All 78 numbers."""
    return cases(load_published("kiper2019"), campaign_plan.load_plan("kiper2019"))


@pytest.fixture(scope="session")
def training(printed):
    """The table of the lightest payload."""
    return printed.of_payload(printed.payloads[0])
