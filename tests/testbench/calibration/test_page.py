"""The page about calibration: what it shows can be typed."""

import re
from pathlib import Path

from testbench.cli.calibrate import calibrate
from testbench.rig import load_rig

PAGE = (Path(__file__).parents[3] / "docs" / "calibration.md").read_text("utf-8")


def test_the_rig_of_the_page():
    """It loads, with its calibration and its data sheet."""
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    sensor = load_rig(f'mechanism = "none"\n[loggers.daq]\n{block}').sensors["base_acc"]
    assert [column.unit for column in sensor.columns("base_acc")] == ["V"] * 3
    assert sensor.calibration.sensitivity["y"] == "9.9 mV/g"
    assert sensor.teds.calibration_period_days == 365


def test_the_options_of_the_page():
    """Every option that it names is one of the command's."""
    known = {word for parameter in calibrate.params for word in parameter.opts}
    commands = re.findall(r"```\n(testbench calibrate.*?)```", PAGE, re.DOTALL)
    assert len(commands) == 2
    assert set(re.findall(r"--[a-z]+", " ".join(commands))) <= known
