"""The simulated test bench: what loggers would write if a mechanism ran on an elastically mounted base.

Downwards: ``campaign`` makes folders of logs of a plan, ``run`` one run without noise, ``loggers`` clocks and noise,
``sensors`` what each sensor sees, ``supports`` how the load is shared, ``base`` how the base moves.
Nothing in the analysis imports ``truth``.
"""
