"""A campaign of two runs."""

import json

import numpy as np
import pytest

from testbench.cli.campaign import verify

from .stored import ACC, store


@pytest.fixture
def two_runs(tmp_path):
    """A folder with two runs and their digests."""
    for number, name in enumerate(("a", "b")):
        store(tmp_path, ACC, [np.full(3, float(number))], name=name)
    return tmp_path


@pytest.fixture
def verified(capsys):
    """What ``testbench verify`` says of each file that is not intact, and its exit code."""

    def states(folder):
        capsys.readouterr()
        code = verify.main([str(folder), "--json"], standalone_mode=False)
        files = json.loads(capsys.readouterr().out)["files"]
        return {file["name"]: file["status"] for file in files if file["status"] != "intact"}, code

    return states
