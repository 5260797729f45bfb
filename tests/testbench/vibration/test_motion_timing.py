"""When a run rests and moves, by accelerometers in a floor louder than what they feel, on a clock of their own."""

import re
from functools import cache

import numpy as np
import pytest

from balance import datasets
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.report.traces import channel_trace, motion_begins
from testbench.rig.sensors import Accelerometer
from testbench.runs.si_run import SIRun
from testbench.synchronization import known_clocks
from testbench.synchronization.clock_map import ClockMap, same_clock
from testbench.vibration.motion_timing import MotionTiming


@cache
def scene() -> memory.Scene:
    """Balanced, with a line that controller and accelerometers both record."""
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    for logger in ("controller", "daq"):
        text += f'\n[sensors.trigger_{logger}]\nkind = "trigger"\nlogger = "{logger}"\nchannel = "{logger}_sync"\n'
    return memory.scene("x", rig=rigs.rig_from_text(text))


def in_a_floor(seed: int, triggers: bool) -> SIRun:
    """A run whose accelerometers show thirty times as much noise as vibration."""
    run, rng = scene().run(seed), np.random.default_rng(seed)
    for column in scene().rig.columns_of(Accelerometer):
        group, index = run.find(column.channel)
        values = run.channels_at([(group, index)])[0]
        run = memory.with_values(run, column.channel, values + 30.0 * values.std() * rng.standard_normal(len(values)))
    text = scene().rig.text
    return SIRun.of(run, rigs.rig_from_text(text if triggers else text.replace("_sync", "_unplugged")))


@pytest.mark.parametrize(
    ("by", "clocks"),
    [
        ("trigger", r"the trigger that the rig names \(1 edge, controller_sync with daq_sync; drift unknown, .*\)"),
        ("record", "recorded alignments"),
        ("nothing", ""),
        ("rough record", r"recorded alignments, within \d+ ms, where 3 ms are needed"),
        (
            "trigger and rough record",
            r"the trigger that the rig names \(1 edge, controller_sync with daq_sync; drift unknown, .*\)",
        ),
    ],
)
def test_command_of_another_logger(by, clocks, monkeypatch):
    """Where a trigger or a recorded alignment relates the clocks, the command tells it, and the whole rest shows the
    noise of what is laid over another run; what is felt does not.
    """
    starts = scene().starts(3)
    moves = scene().bench.time[np.argmax(scene().seen["daq_sync"] > 0.0)]
    begin, rough = moves - starts["daq"]["start"], 0.02 * ("rough" in by)
    late = starts["daq"]["start"] - starts["controller"]["start"]
    clock = ClockMap(0.0, late, 0.0, np.diag([(1e-4 + rough) ** 2, 1e-10]), 1000, (0.0, 1.0))
    maps = {"controller": same_clock((0.0, 0.0)), "daq": clock} if "record" in by else {}
    monkeypatch.setattr(known_clocks, "stored_clock_maps", lambda path: maps)
    run = in_a_floor(3, "trigger" in by)
    timing, (column, *_) = MotionTiming.of(run, "daq"), run.rig.columns_of(Accelerometer)
    shown = channel_trace(run, "", "felt", "m/s2", column)
    assert re.fullmatch(clocks, timing.clocks)
    assert timing.timed == (by not in ("nothing", "rough record"))
    if timing.timed:
        assert timing.moving[0] == pytest.approx(begin, abs=0.004)
        assert timing.rest[1] == pytest.approx(begin - 0.006, abs=0.004)
        variance, freedom = shown.noise(motion_begins([shown]))
        assert variance == pytest.approx(np.var(run.readings(column)), rel=5.0 * (2.0 / freedom) ** 0.5)
        assert freedom > 0.5 * timing.rest[1] * run.rate(column)
    else:
        assert timing.moving is None or abs(timing.moving[0] - begin) > 0.01
