"""The manipulator, and its runs along three motions; aligned once for all tests of a process."""

import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory

MOTIONS = ("x", "y", "triangle")


@pytest.fixture(scope="session")
def manipulator():
    """The mechanism without payload and counter-masses."""
    return load_mechanism(memory.MANIPULATOR)


@pytest.fixture(scope="session")
def runs():
    """A run of each motion with the counter-masses that were built."""
    return [memory.scene(motion).run(k) for k, motion in enumerate(MOTIONS)]


@pytest.fixture(scope="session")
def aligned(runs, manipulator):
    """The same on one clock."""
    return memory.aligned(runs, manipulator)
