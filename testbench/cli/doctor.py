"""``testbench doctor``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.results import table

from . import options

if TYPE_CHECKING:
    from ..cross_examination import Examination


@click.command(
    epilog="""\b
Examples:
  testbench doctor campaign
  testbench doctor campaign r003 r004 --json
\b
Exit codes: 0 nothing contradicts, 3 done with findings, 1 no campaign or no such run."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@click.argument("runs", metavar="[RUN]...", nargs=-1)
@click.option("--mechanism", metavar="MECH", help="The mechanism, where the stored rig names one that is not shipped.")
@options.accept_option
@json_option
def doctor(campaign: Path, runs: tuple[str, ...], mechanism: str | None, accept: tuple[str, ...], as_json: bool) -> int:
    """Cross-examine a campaign, run by run, worst first: does what its sensors show fit the run table and each other?

    Encoders, commands, torques, forces, accelerometers and the model witness payload, counter-masses, peak
    acceleration, motion, and of each sensor the axis, sign and gain; dead channels, levels that drift, and copies of
    runs are found. All runs of the campaign are heard; those named are shown.
    """
    from balance.mechanism.mjcf_parser import load_mechanism

    from ..cross_examination import examine
    from ..errors import StoreError
    from ..store import open_campaign

    options.refuse_unknown_codes(accept)
    stored = open_campaign(campaign).runs
    names = [run.name for run in stored]
    if wrong := [run for run in runs if run not in names]:
        raise StoreError(f"{campaign}: no run {wrong[0]!r}: expected some of {', '.join(names[:12])}")
    examination = examine(stored, accept, load_mechanism(mechanism) if mechanism else None)
    shown = sorted(runs or examination.runs, key=lambda run: -len(examination.about(run)))
    if as_json:
        emit_json(examination.document(shown))
    else:
        _print(campaign, examination, shown)
    return EXIT_WITH_FINDINGS if any(examination.about(run) for run in shown) else 0


def _print(campaign: Path, examination: "Examination", shown: list[str]) -> None:
    from ..cross_examination import Statement

    click.echo(f"{campaign.name}: {examination.verdict(shown)}")
    doubtful = [s for run in shown for s in examination.about(run)]
    if doubtful:
        emit_table("Contradictions", *table(Statement, doubtful))
    sharing: dict[str, list[str]] = {}
    for run in shown:
        if missing := examination.unwitnessed(run):
            reasons = "; ".join(dict.fromkeys(examination.reasons[run].values()))
            text = f"nothing witnesses {', '.join(missing)}{f' ({reasons})' if reasons else ''}"
            sharing.setdefault(text, []).append(run)
    for text, runs in sharing.items():
        click.echo(f"{', '.join(runs)}: {text}")
