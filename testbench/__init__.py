"""Mechanics in the lab: logs to HDF5, reductions of vibration, and what is still unbalanced.

>>> import testbench
>>> campaign = testbench.open_campaign("campaign")
>>> campaign["r001"].to_pandas(resample="1 kHz").attrs["origin"]
'simulated'
>>> testbench.analyze(campaign).table()["axis"].tolist()
['x', 'y', 'z']

Names are imported when they are asked for; what is kept of them, and for how long, is as in ``balance``.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

_MECHANICS = find_spec("balance")
if _MECHANICS is None or 'DISTRIBUTION = "counterpoise"' not in Path(str(_MECHANICS.origin)).read_text("utf-8"):
    raise ImportError(
        f"{_MECHANICS and _MECHANICS.origin}: the package balance is another distribution's, or is missing: "
        "pip uninstall balance, then pip install --force-reinstall --no-deps counterpoise; or give each an environment "
        "of its own"
    )

if TYPE_CHECKING:
    from balance.errors import CounterpoiseError

    from .cross_examination import Examination
    from .front_door import (
        align,
        analyze,
        compare,
        doctor,
        encoder_speed,
        formats,
        identify,
        ingest,
        load_plan,
        load_rig,
        new_project,
        read,
        simulate,
        trim,
    )
    from .identification import Identification
    from .recording import Finding, Recording
    from .rig import Rig
    from .runs.aligned_run import AlignedRun
    from .runs.si_run import SIRun, physical
    from .signal.filters import Band
    from .store import Campaign, Run, open_campaign, open_run
    from .trimming import Trim
    from .vibration.comparison import Comparison
    from .vibration.metrics import Measure
    from .vibration.reduction import Analysis, Reduction

    __version__: str

__all__ = [
    "AlignedRun",
    "Analysis",
    "Band",
    "Campaign",
    "Comparison",
    "CounterpoiseError",
    "Examination",
    "Finding",
    "Identification",
    "Measure",
    "Recording",
    "Reduction",
    "Rig",
    "Run",
    "SIRun",
    "Trim",
    "align",
    "analyze",
    "compare",
    "doctor",
    "encoder_speed",
    "formats",
    "identify",
    "ingest",
    "load_plan",
    "load_rig",
    "new_project",
    "open_campaign",
    "open_run",
    "physical",
    "read",
    "simulate",
    "trim",
]
_HOMES = {
    "AlignedRun": "runs.aligned_run",
    "Analysis": "vibration.reduction",
    "Band": "signal.filters",
    "Campaign": "store",
    "Comparison": "vibration.comparison",
    "CounterpoiseError": "errors",
    "Examination": "cross_examination",
    "Finding": "recording",
    "Identification": "identification",
    "Measure": "vibration.metrics",
    "Recording": "recording",
    "Reduction": "vibration.reduction",
    "Rig": "rig",
    "Run": "store",
    "SIRun": "runs.si_run",
    "Trim": "trimming",
    "open_campaign": "store",
    "open_run": "store",
    "physical": "runs.si_run",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """What is public here is imported when it is asked for, so that the command line starts at once."""
    from importlib import import_module

    if name == "__version__":
        from importlib.metadata import version

        return version("counterpoise")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES.get(name, 'front_door')}", __name__), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
