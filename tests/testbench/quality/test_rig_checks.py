"""A rig against the logs: what a commanded channel may do."""

from pathlib import Path

import pytest

from testbench import rig
from testbench.quality import rig_checks
from testbench.quality.group_checks import GroupCheck
from testbench.recording import Channel, Finding, Group, Recording, SensorRange


def log_of(*channels: Channel, path: str = "r.csv") -> Recording:
    """A log of these channels, without data."""
    return Recording(Path(path), "CSV", "csv", (Group("r", channels),), lambda report: iter(()))


def test_a_commanded_channel_may_rest_and_hold() -> None:
    """A target that stays at zero, or at its plateau, is no dead channel and no clipping; a sensor's is."""
    channels = (Channel("TargetX (m/s^2)", "m/s^2", "TargetX"), Channel("AccX (g)", "g", "AccX"))
    recording = log_of(*channels)
    found = [Finding(code, c.name, None, "") for c in channels for code in ("constant_channel", "clipping_suspected")]
    found.append(Finding("not_a_number", "TargetX (m/s^2)", None, ""))
    left = rig_checks.without_commanded(rig.load_rig("parallelogram-6bar"), recording, found)
    assert [(f.code, f.channel) for f in left] == [
        ("constant_channel", "AccX (g)"), ("clipping_suspected", "AccX (g)"), ("not_a_number", "TargetX (m/s^2)")
    ]  # fmt: skip
    assert rig_checks.without_commanded(None, recording, found) == found


@pytest.mark.parametrize(("samples", "codes"), [(1, ["few_samples"]), (3, ["few_samples"]), (4, [])])
def test_a_log_of_a_few_samples(samples, codes):
    """Of a logger of the rig it is named; a group of other channels may hold as few as it likes."""
    bench = rig.load_rig("parallelogram-6bar")
    checks = [GroupCheck(Group("r", (Channel(name, "g"),)), samples=samples) for name in ("AccX", "Temperature")]
    assert [f.code for f in rig_checks.rate_findings(bench, checks)] == codes


def test_channels_are_called_with_their_unit_or_without() -> None:
    """Ranges, rates and what may rest hold for both; of two sensors with one channel between them one is refused."""
    text = """mechanism = "none"
[loggers.daq]
rate = "1 kHz"
[sensors.acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "Beschl. X [m/s²]" }
range = "20 m/s^2"
position = ["0 m", "0 m", "0 m"]
[sensors.target]
kind = "target"
logger = "daq"
channels = { x = "Soll", y = "Beschl. Y" }
"""
    channels = (
        Channel("Beschl. X [m/s²]", "m/s²", "Beschl. X"),
        Channel("Beschl. Y [m/s²]", "m/s²", "Beschl. Y"),
        Channel("Soll [m/s²]", "m/s²", "Soll"),
    )
    log = log_of(*channels)
    bench = rig.load_rig(text)
    assert rig_checks.rig_findings(bench, [log]) == []
    check = GroupCheck(Group("r", channels), channel_ranges={"Beschl. X [m/s²]": SensorRange(20.0, "m/s^2")})
    assert [known and known.limit for known in map(check._range, channels)] == [20.0, None, None]
    assert [f.code for f in rig_checks.rate_findings(bench, [GroupCheck(Group("r", channels), samples=3)])] == [
        "few_samples"
    ]
    found = [Finding("constant_channel", c.name, None, "") for c in channels]
    assert [f.channel for f in rig_checks.without_commanded(bench, log, found)] == ["Beschl. X [m/s²]"]
    twice = rig.load_rig(text.replace('"Beschl. Y"', '"Beschl. X"'))
    (finding,) = rig_checks.rig_findings(twice, [log])
    assert finding.message == "the rig calls this channel 'Beschl. X [m/s²]' too: expected one sensor a channel"


@pytest.mark.parametrize(
    ("key", "logged", "limit"), [("", "kN", 0.5), ("", "mN", 5e5), ("", None, 500.0), ('unit = "N"', "kN", 500.0)]
)
def test_a_range_holds_in_the_unit_of_the_log(key, logged, limit):
    """A log that states its unit, where the rig states none, is held against the range in that unit."""
    bench = rig.load_rig(
        f"""mechanism = "none"
[loggers.daq]
[sensors.plate]
kind = "force"
logger = "daq"
channels = {{ x = "Fx" }}
range = "500 N"
position = ["0 m", "0 m", "0 m"]
{key}
"""
    )
    log = log_of(Channel("Fx", logged))
    (found,) = rig_checks.channel_ranges(bench, log).values()
    assert found.limit == pytest.approx(limit, rel=1e-12)


def test_a_log_may_hold_a_column_that_is_called_as_one_of_another_logger() -> None:
    """Two logs of the same channels are one too many; a copy of one among others is the other logger's own matter."""
    text = 'mechanism = "none"\n[loggers.daq]\n[loggers.plc]\n' + "".join(
        f'[sensors.{name}]\nkind = "trigger"\nlogger = "{logger}"\nchannel = "{name}"\n'
        for name, logger in (("a", "daq"), ("b", "plc"), ("c", "plc"))
    )

    def said(*logs: str) -> list[str]:
        recordings = [log_of(*map(Channel, held), path=name) for name, held in zip("PQR", logs, strict=False)]
        found = rig_checks.rig_findings(rig.load_rig(text), recordings)
        return [one.message.partition(":")[0] for one in found if one.code == "logger_twice"]

    assert said("ab", "bc") == said("a", "bc", "x") == []
    assert said("ax", "bc", "ay") == ["P and R both hold a of logger daq"]
    assert said("abc", "abc", "cba") == ["P and Q and R all hold a, b, c of logger daq, plc"]


def test_a_unit_that_nobody_knows(tmp_path: Path) -> None:
    """The cure is said, with a calibration and without one; with the unit in the rig it is no contradiction."""
    text = """mechanism = "none"
[loggers.daq]
[sensors.encoder]
kind = "encoder"
logger = "daq"
channel = "Winkel"
joint = "A0"
"""
    calibration = '[sensors.encoder.calibration]\nsensitivity = "4096 counts/rev"\n'
    log = log_of(Channel("Winkel", "Inkr"))
    for rest, codes in (
        ("", ["rig_contradiction"]),
        (calibration, ["calibration_contradiction"]),
        ('unit = "counts"\n' + calibration, []),
    ):
        (tmp_path / "rig.toml").write_text(text + rest, "utf-8")
        found = rig_checks.rig_findings(rig.load_rig(tmp_path / "rig.toml"), [log])
        assert [f.code for f in found] == codes
        assert all("state which it is in the rig, as unit of sensors.encoder" in f.message for f in found)


def test_loggers_that_no_log_of_the_run_holds() -> None:
    """A rig of the whole bench: what another log of the run holds is no finding; what none holds is, with the logs."""
    bench = rig.load_rig("parallelogram-6bar")
    logs = [
        log_of(*(Channel(c.channel, c.unit) for c in bench.columns(logger)), path=f"lab/r1_{logger}.csv")
        for logger in bench.loggers
    ]
    assert not rig_checks.rig_findings(bench, logs)
    forces, controller = rig_checks.rig_findings(bench, logs[:1])
    assert {f.code for f in (forces, controller)} == {"sensor_not_recorded"}
    assert "sensors k6d40, kistler, futek_1, futek_2 (logger forces)" in forces.message
    assert "is in r1_daq.csv, of which the run is made" in forces.message
    (controller,) = rig_checks.rig_findings(bench, logs[:2])
    assert "(logger controller): no channel of theirs is in any of r1_daq.csv, r1_forces.csv" in controller.message
    assert "by a run table (--runs)" in controller.message
