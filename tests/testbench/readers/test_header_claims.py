"""What a log says of its origin is heard in every format."""

import numpy as np
import pytest
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat

from testbench.export import TARGETS, export
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.readers import open_recording
from testbench.readers.header_claims import stated_origin
from testbench.store import open_run

from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A simulated run of a hundred and fifty channels, so that their units alone take thousands of letters."""
    names = ",".join(f"channel_{i} (m/s^2)" for i in range(150))
    rows = "".join(f"{i / 1000}" + f",{i % 7}.5" * 150 + "\n" for i in range(50))
    tmp_path = tmp_path_factory.mktemp("stored")
    (tmp_path / "run.csv").write_text(f"# origin: simulated\nTime (s),{names}\n{rows}")
    (outcome,) = Ingest(tmp_path / "c").run(PlannedRun("run", (tmp_path / "run.csv",)))
    return open_run(tmp_path / "c" / outcome.file)


@pytest.mark.parametrize("to", TARGETS)
def test_what_is_exported_stays_simulated(stored, tmp_path, to):
    """Whatever a simulated run is exported to comes back as simulated, and cannot be called measured."""
    (exported,) = export(stored, to, tmp_path / "out")
    assert open_recording(exported.file).origin == "simulated"
    (outcome,) = Ingest(tmp_path / "d").run(PlannedRun("again", (exported.file,), "measured", {}))
    assert [f.code for f in outcome.findings] == ["origin_contradiction"]


def test_a_stored_run_is_no_log(stored, tmp_path):
    """It would lose origin, conditions and sources; what to do is said."""
    (outcome,) = Ingest(tmp_path / "d").run(PlannedRun("again", (stored.path,)))
    assert (outcome.status, [f.code for f in outcome.findings]) == ("refused", ["stored_run"])
    assert "testbench archive" in outcome.message
    assert not (tmp_path / "d").exists()


def test_a_property_says_it(tmp_path):
    """Of a TDMS file, of a variable of MATLAB; the data are those of the file."""
    values = np.arange(50.0)
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        channel = ChannelObject("g", "a", values, {"wf_increment": 0.001})
        writer.write_segment([RootObject({"Origin": "Simulated"}), channel])
    savemat(tmp_path / "b.mat", {"origin": "simulated", "a": values})
    for name in ("a.tdms", "b.mat"):
        found = open_recording(tmp_path / name)
        assert found.origin == "simulated", name
        (block,) = found.blocks(lambda finding: None)
        assert block.columns[0].tobytes() == values.tobytes()


@pytest.mark.parametrize(
    "text", ["origin: measured", "original: simulated", "the origin is not simulated", "simulated", ""]
)
def test_what_says_something_else(text):
    """Only the origin itself counts, and only that it is simulated."""
    assert stated_origin([text]) == "unstated"
