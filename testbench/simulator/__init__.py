"""The simulated test bench: what loggers would write if a mechanism ran on an elastically mounted base.

From the top: ``campaign`` writes the logs of a plan and the truth, ``simulated_logs`` makes runs in memory, ``run`` one
run. Random parts: ``loggers`` (clock, filter, noise, quantization), ``sensors`` (sensitivity, offset, drift) and
``disturbances`` (floor, roughness of drives). Mechanics: ``moving_base_coupling`` and ``added_bodies``. No analysis
imports the simulator except the comparison of reductions.
"""
