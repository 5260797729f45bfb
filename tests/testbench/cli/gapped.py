"""Logs of a campaign with rows taken out, as a logger that paused leaves them, or with rows changed."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from testbench import rig as rigs
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs as sheet
from testbench.simulator.campaign import RUN_TABLE

from ..conftest import Simulated


def without_rows(
    made: Simulated,
    folder: Path,
    cuts: Mapping[str, tuple[float, float]],
    changed: Mapping[str, Callable[[str], str]] | None = None,
) -> Path:
    """The campaign of the same logs, less the rows of some from one instant of their clock to another [s].

    Of others, rows are ``changed``. Runs of logs that stay are those of the campaign.
    """
    logs = Path(shutil.copytree(made.logs, folder / "logs", ignore=shutil.ignore_patterns("truth")))
    campaign = Path(shutil.copytree(made.campaign, folder / "campaign"))
    for name, (begin, end) in cuts.items():
        lines = (logs / name).read_text("utf-8").splitlines(keepends=True)
        kept = [line for line in lines if not line[0].isdigit() or not begin <= float(line.split(",")[0]) < end]
        assert len(kept) < len(lines)
        (logs / name).write_text("".join(kept), "utf-8")
    for name, change in (changed or {}).items():
        lines = (logs / name).read_text("utf-8").splitlines(keepends=True)
        (logs / name).write_text("".join(change(x) if x[0].isdigit() else x for x in lines), "utf-8")
    touched = {name.partition("_")[0] for name in (*cuts, *(changed or {}))}
    for path in campaign.iterdir():
        if path.name.partition(".")[0] in touched:
            path.unlink()
    ingest = Ingest(campaign, rigs.load_rig("parallelogram-6bar"))
    for run in sheet(sorted(logs.glob("r*.csv")), logs / RUN_TABLE):
        expected = "stored" if run.name in touched else "already_stored"
        assert {outcome.status for outcome in ingest.run(run)} == {expected}
    return campaign
