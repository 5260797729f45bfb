"""The rig file: what it reads into SI, and the key that each wrong value is blamed on."""

import numpy as np
import pytest

from balance import datasets
from testbench.errors import RigError
from testbench.rig import load_rig

TEXT = """
mechanism = "parallelogram-6bar"
[loggers.daq]
clock = "uniform"
[loggers.forces]
[sensors.base_acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "AccX", y = "AccY" }
unit = "g"
range = "50 g"
position = ["0.20 m", "-10 cm", "0 m"]
[sensors.k6d40]
kind = "wrench"
logger = "forces"
channels = { Fx = "Fx1", Mz = "Mz1" }
range = { F = ["500 N", "500 N", "2 kN"], M = "20 N m" }
position = ["0 m", "0 m", "0 m"]
[sensors.futek]
kind = "force"
logger = "forces"
channel = "Fz3"
axis = "z"
range = "1112 N"
position = ["0 m", "0 m", "0 m"]
"""


def test_g_is_g0():
    """In an acceleration, g is g0 = 9.81 m/s2 and not a gram."""
    rig = load_rig(TEXT)
    (acc,) = rig.base_accelerometers.values()
    assert acc.range == pytest.approx([490.5] * 3)
    assert next(rig.columns("daq")).written(np.array([9.81])) == pytest.approx(1.0)


def test_si():
    """Lengths, forces and moments are read into SI, each with its component."""
    columns = {column.channel: column for column in load_rig(TEXT).columns()}
    assert load_rig(TEXT).base_accelerometers["base_acc"].position == pytest.approx((0.2, -0.1, 0.0))
    assert (columns["Fx1"].range, columns["Mz1"].range, columns["Fz3"].range) == (500.0, 20.0, 1112.0)
    assert [columns[name].component for name in ("AccX", "Fx1", "Mz1", "Fz3")] == ["x", "Fx", "Mz", "Fz"]


def test_axis_stiffness():
    """A support carries only what its sensor measures."""
    supports = load_rig(TEXT).supports
    assert [k > 0 for k in supports["k6d40"].axis_stiffness] == [True, False, False, False, False, True]
    assert [k > 0 for k in supports["futek"].axis_stiffness] == [False, False, True, False, False, False]


def test_shipped():
    """The shipped rig has the sensors of the source, with their capacities, between mechanism and base."""
    rig = load_rig("parallelogram-6bar")
    ranges = {column.channel: column.range for column in rig.columns("forces")}
    assert ranges["Fz1"] == 2000.0
    assert ranges["Mx1"] == 20.0
    assert ranges["Fy2"] == 2000.0
    assert ranges["Fz4"] == 1112.0
    assert {sensor.between for sensor in rig.supports.values()} == {("mechanism", "base")}


def test_text():
    """The text stays as written."""
    path = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml")
    assert load_rig(path).text == path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "key", "said"),
    [
        ('"50 g"', '"50 q"', "sensors.base_acc.range", "'50 q'"),
        ('"50 g"', '"-50 g"', "sensors.base_acc.range", "more than zero"),
        ('"50 g"', "50", "sensors.base_acc.range", "no unit"),
        ('"2 kN"', '"2 kW"', "sensors.k6d40.range.F[2]", "'2 kW'"),
        ('range = "1112 N"', 'rang = "1112 N"', "sensors.futek.rang", "did you mean 'range'"),
        ('kind = "force"', 'kind = "forces"', "sensors.futek.kind", "did you mean 'force'"),
        ('kind = "force"', "", "sensors.futek.kind", "missing"),
        ('axis = "z"', "", "sensors.futek", "channel and axis"),
        ('axis = "z"', 'axis = "z"\nunloaded = ["rest"]', "sensors.futek.unloaded", "['rest']: expected 'rest'\n"),
        ('unit = "g"', 'unit = "N"', "sensors.base_acc.unit", "acceleration"),
        ('logger = "daq"', 'logger = "dac"', "sensors.base_acc.logger", "did you mean 'daq'"),
        ('channel = "Fz3"', 'channel = "Fx1"', "sensors.futek", "sensors.k6d40: expected one sensor a channel\n"),
        ('channel = "Fz3"', 'channel = "AccX"', "sensors.futek", "channels = { 'AccX' = 'AccX forces' }"),
        ('clock = "uniform"', 'clok = "uniform"', "loggers.daq.clok", "did you mean 'clock'"),
        ('clock = "uniform"', 'rate = "5 kg"', "loggers.daq.rate", "'5 kg'"),
        (
            '["0.20 m", "-10 cm", "0 m"]',
            '["0.20 m", "-10 cm"]',
            "sensors.base_acc.position",
            "missing: expected one value more",
        ),
        ('mechanism = "parallelogram-6bar"', "", "mechanism", "missing"),
    ],
)
def test_wrong_value(old, new, key, said):
    """A wrong value is blamed on its key."""
    with pytest.raises(RigError) as refusal:
        load_rig(TEXT.replace(old, new, 1))
    assert f"{key}: " in str(refusal.value)
    assert said in f"{refusal.value}\n"


def test_no_toml():
    """What is no TOML is refused, with the line."""
    with pytest.raises(RigError, match="line 2"):
        load_rig("name = 'a'\n[loggers\n")


def test_unknown_name():
    """An unknown name lists the shipped rigs."""
    with pytest.raises(RigError, match="parallelogram-6bar"):
        load_rig("parallelogram-7bar")


def calibrated(table, sensor="acc"):
    """A rig with one calibrated accelerometer."""
    return f"""
mechanism = "none"
[loggers.daq]
[sensors.{sensor}]
kind = "accelerometer"
logger = "daq"
channels = {{ x = "a" }}
position = ["0 m", "0 m", "0 m"]
{table}
"""


def test_calibration_and_teds():
    """They stand beside the sensor; nothing of them changes what a channel is."""
    text = calibrated(
        '[sensors.acc.calibration]\nsensitivity = "10.2 mV/g"\ndate = 2026-03-31\nreference = "certificate 12"\n'
        '[sensors.acc.teds]\nmanufacturer = "M"\nversion_letter = "A"\nserial = "2007"\ncalibration_date = 2026-03-31'
    )
    sensor = load_rig(text).sensors["acc"]
    assert str(sensor.calibration) == "10.2 mV/g, calibrated 2026-03-31, certificate 12"
    assert sensor.teds.document() == {
        "manufacturer": "M", "version_letter": "A", "serial": "2007", "calibration_date": "2026-03-31",
    }  # fmt: skip
    (column,) = load_rig(text).columns()
    assert (column.unit, column.stated) == ("", False)


@pytest.mark.parametrize(
    ("table", "key", "said"),
    [
        (
            '[sensors.acc.calibration]\nsensitivty = "1 mV/g"',
            "sensors.acc.calibration.sensitivty",
            "mean 'sensitivity'",
        ),
        ('[sensors.acc.calibration]\nreference = "x"', "sensors.acc.calibration", "expected one of"),
        ('unit = "V"\n[sensors.acc.calibration]\nsensitivity = "1 mV/N"', "sensors.acc", "no acceleration"),
        ('unit = "V"\n[sensors.acc.calibration]\nsensitivity = "1 mV/g"\nunit = "mV"', "sensors.acc", "state it once"),
        ('[sensors.acc.calibration]\nsensitivity = { q = "1 mV/g" }', "sensors.acc", "no component 'q'"),
        (
            '[sensors.acc.calibration]\nsensitivity = "1 mV/g"\ndate = "31.3."',
            "sensors.acc.calibration.date",
            "2026-03",
        ),
        ('[sensors.acc.teds]\nversion_letter = "AB"', "sensors.acc.teds.version_letter", "AB"),
        ('unit = "N"', "sensors.acc.unit", "or an electrical one"),
    ],
)
def test_a_calibration_that_cannot_be(table, key, said):
    """It is blamed on its key."""
    with pytest.raises(RigError) as refusal:
        load_rig(calibrated(table))
    assert f"{key}: " in str(refusal.value)
    assert said in f"{refusal.value}\n"
