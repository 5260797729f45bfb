"""``testbench simulate``."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import command, option
from balance.cli.options import SCHEDULER, progress
from balance.cli.printing import say

if TYPE_CHECKING:
    from ..rig import Rig


@command(
    epilog="""\b
Examples:
  testbench simulate --plan kiper2019 --rig parallelogram-6bar -o logs
  testbench simulate --plan kiper2019-brief --rig parallelogram-6bar-deep --seed 7 -o logs
  testbench ingest logs/r*.csv --rig parallelogram-6bar --runs logs/runs.csv -o campaign

\b
What a rig may state of the bench, in [bench], and of its loggers:
  fixed                                     a base that does not move; or one that does:
  coupling, planes, rotors, weight, tilt    mechanics of a base that moves
  unstated_mass                             what moves beyond the mechanism's file
  drives, joints, links, contact            drives, joints and links that yield, with play; feet that lift
  stacks, rider                             plates of counter-masses, what rides on force sensors
  floor, floor_modes, roughness, modes      other vibration
  errors                                    sensors that are not what their data sheet says
  start_scatter, drift_scatter_ppm, jitter, lost, dropouts_per_minute, low_pass    [loggers.NAME]
parallelogram-6bar states none of these, parallelogram-6bar-deep all but the first; docs/bench.md explains each."""
)
def simulate(
    plan: str = option(
        "Which runs: a plan file, or a shipped one: kiper2019, kiper2019-brief, kiper2019-deep.",
        required=True,
        metavar="PLAN",
    ),
    rig: str = option(
        "A rig file, or a shipped one: parallelogram-6bar, parallelogram-6bar-deep.", required=True, metavar="RIG"
    ),
    folder: Path = option("A new or empty folder.", None, "-o", "--output", required=True),
    seed: int | None = option("Seed of all that is drawn; the plan's own unless given.", click.IntRange(min=0)),
    scheduler: str | None = SCHEDULER,
) -> None:
    """Make the logs that a test bench would write, each marked as simulated, and the run table.

    The truth is in FOLDER/truth, which no analysis reads. The same plan, rig and seed give the same logs.
    """
    from balance.task_pool import task_pool

    from .. import campaign_plan as plans
    from .. import rig as rigs
    from ..simulator.campaign import RUN_TABLE, simulate_campaign

    planned, bench = plans.load_plan(plan), rigs.load_rig(rig)
    if seed is not None:
        planned = planned.model_copy(update={"seed": seed})
    with task_pool(scheduler) as pool, progress("simulating", len(planned.runs()), in_bytes=False) as done:
        logs = simulate_campaign(planned, bench, folder, done, pool)
    size = sum(path.stat().st_size for path in logs) / 1e6
    say(f"{len(planned.runs())} simulated runs, {len(logs)} logs, {size:.1f} MB in {folder}; run table {RUN_TABLE}.")
    for line in _assumed(bench):
        say(line)


def _assumed(rig: "Rig") -> Iterator[str]:
    """Assumptions for what the rig does not state."""
    if "bench" not in rig.model_fields_set:
        yield "The rig has no [bench]: a steel frame of 150 kg on four rubber feet was assumed."
    if silent := [name for name, logger in rig.loggers.items() if "rate" not in logger.model_fields_set]:
        yield f"The rig states no rate for {', '.join(silent)}: {rig.loggers[silent[0]].rate:g} Hz was assumed."
