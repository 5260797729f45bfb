"""The printed numbers with their mechanics, computed once."""

import pytest

from studies.kiper2019.model import cases
from testbench import plan
from testbench.published import load


@pytest.fixture(scope="session")
def printed():
    """All 78 numbers."""
    return cases(load("kiper2019"), plan.load("kiper2019"))


@pytest.fixture(scope="session")
def training(printed):
    """The table of the lightest payload."""
    return printed.of_payload(printed.payloads[0])
