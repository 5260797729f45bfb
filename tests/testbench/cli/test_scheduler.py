"""``--scheduler``: runs that are ingested, examined and reported in other processes, with the same result."""

import shutil
import subprocess
import sys

import pytest

from balance.cli.printing import json_text
from balance.task_pool import HERE
from testbench.cross_examination.examination import examine
from testbench.report import Reporting
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


def test_analysis_in_copies_of_this_process(brief, tmp_path):
    """Runs, sides, and conditions are shared out: the same document, to the last bit; in a process without threads."""
    code = """import sys
from balance.cli.printing import json_text
from balance.results import document
from balance.task_pool import HERE, TaskPool, _can_fork
import testbench
assert _can_fork()
here, there = (json_text(document(testbench.analyze(sys.argv[1], pool=pool))) for pool in (HERE, TaskPool(None, 2)))
assert len(here) > 1000 and here == there
"""
    for path in brief.campaign.glob("r00[1-4].*"):
        shutil.copy(path, tmp_path)
    command = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_reports(pair_built):
    """To report a run is a task, which observes it too: the same reports, curves and statements."""
    runs = open_campaign(pair_built.campaign).runs
    (seen, here, _), (also, there, _) = (Reporting().runs(runs, (), pool, 200) for pool in (HERE, OtherProcess(None)))
    assert seen.statements == also.statements
    assert list(here) == list(there) == [run.name for run in runs]
    for name, one in here.items():
        assert json_text(one.as_dict()) == json_text(there[name].as_dict())
        assert one.plotted.as_dict() == there[name].plotted.as_dict()
