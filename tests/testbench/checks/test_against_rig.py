"""A rig against the logs: what a commanded channel may do."""

from pathlib import Path

from testbench import rig
from testbench.checks import against_rig
from testbench.findings import Finding
from testbench.recording import Channel, Group, Recording


def test_a_commanded_channel_may_rest_and_hold() -> None:
    """A target that stays at zero, or at its plateau, is no dead channel and no clipping; a sensor's is."""
    channels = (Channel("TargetX (m/s^2)", "m/s^2", "TargetX"), Channel("AccX (g)", "g", "AccX"))
    recording = Recording(Path("r.csv"), "CSV", "csv", (Group("r", channels),), lambda report: iter(()))
    found = [Finding(code, c.name, None, "") for c in channels for code in ("constant_channel", "clipping_suspected")]
    found.append(Finding("not_a_number", "TargetX (m/s^2)", None, ""))
    left = against_rig.without_commanded(rig.load("parallelogram-6bar"), recording, found)
    assert [(f.code, f.channel) for f in left] == [
        ("constant_channel", "AccX (g)"), ("clipping_suspected", "AccX (g)"), ("not_a_number", "TargetX (m/s^2)")
    ]  # fmt: skip
    assert against_rig.without_commanded(None, recording, found) == found
