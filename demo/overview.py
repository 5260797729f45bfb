"""The picture of the README: the balanced manipulator, and its base acceleration with and without counter-masses."""

from typing import TYPE_CHECKING

from balance.balancing.conditions import balance_conditions
from balance.balancing.sizing import sizing_of_given
from balance.closure import Closure
from balance.figures.mechanism import draw_on
from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import G0
from testbench.figures import style
from testbench.kinematics.encoder_motion import moving_interval
from testbench.runs.si_run import SIRun
from testbench.vibration.metrics import Measure, base_accelerations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from testbench.store import Run


def overview(with_run: "Run", without_run: "Run") -> "Figure":
    """The mechanism of two simulated runs on the left, the base's acceleration along x on the right."""
    from matplotlib.figure import Figure

    conditions = with_run.conditions
    mechanism = load_mechanism(SIRun.of(with_run).rig.mechanism).with_payload({"platform": conditions["payload_kg"]})
    mounted = sizing_of_given(balance_conditions(mechanism), mechanism, conditions["counter_masses"])
    with style.styled():
        figure = Figure(figsize=(9.0, 3.6), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
        draw_on(left, mechanism, mounted.counter_masses, Closure(mechanism).home)
        left.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="Counter-masses for 5 kg")
        measure = Measure()
        signals = [base_accelerations(SIRun.of(run))["base_acc", "x"] for run in (without_run, with_run)]
        shapes = [measure.shape(*signal) / G0 for signal in signals]
        span = moving_interval(shapes[0], signals[0][1], margin_s=0.05)
        series = [([i / rate for i in range(span.stop - span.start)], shape[span]) for shape, (_, rate) in
                  zip(shapes, signals, strict=True)]  # fmt: skip
        style.two_runs(right, series[0], series[1])
        right.set(xlabel="time [s]", ylabel="base acceleration along x [g0]", title="Simulated, moves of 3 g0 along x")
        right.legend(loc="lower right")
    return figure
