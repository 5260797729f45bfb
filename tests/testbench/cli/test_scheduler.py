"""``--scheduler``: runs that are ingested and examined in other processes, with the same result."""

import pytest

from balance.task_pool import HERE
from testbench.cross_examination.examination import examine
from testbench.store import open_campaign

from ...other_process import OtherProcess, other_process


@pytest.fixture
def elsewhere(monkeypatch):
    """Tasks travel."""
    monkeypatch.setattr("balance.task_pool.task_pool", other_process)


def test_ingest(pair_built, command, elsewhere, tmp_path):
    """A run is a task; outcomes in the order of the run table, as they are without."""
    logs = sorted(pair_built.logs.glob("r0*.csv"))
    given = ("--rig", "parallelogram-6bar", "--runs", pair_built.logs / "runs.csv", "-o", tmp_path, "--json")
    code, out, err = command("ingest", *logs, *given, "--scheduler", "local")
    assert (code, err, out.count('"stored"')) == (0, "", len(logs))
    assert out.index("r001") < out.index("r002")
    for run in ("r001.h5", "r002.h5"):
        assert (tmp_path / run).is_file()


def test_examination(pair_built):
    """To examine a run is a task: the same statements."""
    runs = open_campaign(pair_built.campaign).runs
    here, there = (examine(runs, pool=pool) for pool in (HERE, OtherProcess(None)))
    assert here.statements == there.statements
    assert (here.runs, here.reasons) == (there.runs, there.reasons)
