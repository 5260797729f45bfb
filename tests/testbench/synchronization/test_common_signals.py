"""What an AC-coupled accelerometer was exposed to, from its stated lower corner."""

import numpy as np

from testbench.rig import load_rig
from testbench.simulator.loggers import high_pass
from testbench.simulator.sensors import draw_transducers
from testbench.synchronization.common_signals import high_pass_inverted


def test_restored_is_the_inverse():
    """A swing that a high pass at 0.3 Hz made early comes back in time and size, offset of the log or not."""
    rate = 5000.0
    time = np.arange(0.0, 3.0, 1.0 / rate)
    true = np.sin(2.0 * np.pi * 5.0 * (time - 0.5)) * ((time > 0.5) & (time < 2.1))
    shown = high_pass(true, 0.3, 1.0 / rate)
    assert np.max(np.abs(shown - true)) > 0.05
    assert np.max(np.abs(high_pass_inverted(shown + 0.2, rate, 0.3) - true)) < 1e-3
    assert high_pass_inverted(shown, rate, None) is shown


def test_the_bench_has_the_stated_corner():
    """A sensor whose data sheet states a lower corner is simulated with it, also where no error of it is stated."""
    deep = load_rig("parallelogram-6bar-deep")
    assert draw_transducers(deep, 1)["base_acc"].corner == 0.3
    bare = deep.model_copy(update={"bench": deep.bench.model_copy(update={"errors": {}})})
    assert draw_transducers(bare, 1)["base_acc"].corner == 0.3
    assert set(draw_transducers(bare, 1)) == {"base_acc"}
