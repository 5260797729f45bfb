"""Mechanics in the lab: logs to HDF5, reductions of vibration, and what is still unbalanced.

>>> import testbench
>>> campaign = testbench.open_campaign("campaign")
>>> campaign["r001"].to_pandas(resample="1 kHz", channels=["AccX", "AccY"]).attrs["origin"]
'simulated'
>>> testbench.analyze(campaign).table()["axis"].tolist()
['x', 'y', 'z']

Names are imported when they are asked for; what is kept of them, and for how long, is as in ``balance``.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

_MECHANICS = find_spec("balance")
if _MECHANICS is None or 'DISTRIBUTION = "counterpoise"' not in Path(str(_MECHANICS.origin)).read_text("utf-8"):
    raise ImportError(
        f"{_MECHANICS and _MECHANICS.origin}: the package balance is another distribution's, or is missing: "
        "pip uninstall balance, then pip install --force-reinstall --no-deps counterpoise; or give each an environment "
        "of its own"
    )

from balance import lazy_names  # noqa: E402

# Each name is an alias of itself, by which type checkers know it as public.
# isort: off
if TYPE_CHECKING:
    from balance.errors import CounterpoiseError as CounterpoiseError

    from . import export as export, report as report, rotating as rotating
    from .cross_examination import Examination as Examination
    from .front_door import (
        align as align,
        analyze as analyze,
        compare as compare,
        doctor as doctor,
        encoder_speed as encoder_speed,
        formats as formats,
        identify as identify,
        ingest as ingest,
        load_plan as load_plan,
        load_rig as load_rig,
        new_project as new_project,
        overlay as overlay,
        plan_next as plan_next,
        read as read,
        simulate as simulate,
        trim as trim,
    )
    from .identification import Identification as Identification
    from .next_run import Design as Design
    from .recording import Finding as Finding, Recording as Recording
    from .rig import Rig as Rig
    from .runs.aligned_run import AlignedRun as AlignedRun
    from .runs.si_run import SIRun as SIRun, physical as physical
    from .signal.filters import Band as Band
    from .store import Campaign as Campaign, Run as Run, open_campaign as open_campaign, open_run as open_run
    from .trimming import Trim as Trim
    from .vibration.comparison import Comparison as Comparison
    from .vibration.metrics import Measure as Measure
    from .vibration.reduction import Analysis as Analysis, Reduction as Reduction

    __version__: str

__all__, __getattr__, __dir__ = lazy_names(__name__, {
    "runs.aligned_run": "AlignedRun",
    "vibration.reduction": "Analysis Reduction",
    "signal.filters": "Band",
    "store": "Campaign Run open_campaign open_run",
    "vibration.comparison": "Comparison",
    "errors": "CounterpoiseError",
    "next_run": "Design",
    "cross_examination": "Examination",
    "recording": "Finding Recording",
    "identification": "Identification",
    "vibration.metrics": "Measure",
    "rig": "Rig",
    "runs.si_run": "SIRun physical",
    "trimming": "Trim",
    "front_door": "align analyze compare doctor encoder_speed formats identify ingest load_plan load_rig new_project "
    "overlay plan_next read simulate trim",
}, ("export", "report", "rotating"))  # fmt: skip
