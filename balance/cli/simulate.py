"""``balance simulate``."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from . import options
from .console import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

if TYPE_CHECKING:
    from ..closure import Trajectory
    from ..dynamics.inverse_dynamics import Response
    from ..mechanism import Mechanism


@click.command(
    epilog="""\b
Examples:
  balance simulate parallelogram-6bar --motion x --payload platform=5kg
  balance simulate parallelogram-6bar --motion triangle -c counter_A0A=24.28kg -c counter_B0B=24.28kg --csv run.csv"""
)
@options.mechanism_argument
@click.option("--motion", required=True, metavar="TOML", help="A motion file, or a shipped one: x, y, triangle.")
@options.payload_option
@options.counter_option
@click.option("--rate", metavar="RATE", help="Samples per second, with unit [default: 10 kHz].")
@click.option(
    "--csv", type=click.Path(dir_okay=False), metavar="FILE", help="Write the time series as CSV, marked simulated."
)
@click.option("--parquet", type=click.Path(dir_okay=False), metavar="FILE", help="Write the time series as Parquet.")
@json_option
def simulate(
    mechanism: str,
    motion: str,
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    rate: str | None,
    csv: str | None,
    parquet: str | None,
    as_json: bool,
) -> None:
    """Simulate a motion of MECH: shaking force, shaking moment and drive torque.

    Shaking force and moment are what the mechanism exerts on its base, weight excluded, the moment about the origin
    of the base frame; drive torque includes gravity.
    """
    from ..closure import Closure
    from ..dynamics.inverse_dynamics import simulate as respond
    from ..motion import DEFAULT_RATE_HZ
    from ..motion.motion_files import load_motion
    from ..quantities import parse
    from .responses import label, summary

    if csv and parquet and Path(csv).resolve() == Path(parquet).resolve():
        raise click.UsageError(f"--csv and --parquet name one file, {csv}: give each its own")
    model = options.load(mechanism, payload).with_counter_mass(options.once(counter, "--counter"))
    samples = load_motion(motion).sample(parse(rate, "frequency") if rate else DEFAULT_RATE_HZ)
    trajectory = Closure(model).follow(samples)
    response = respond(model, trajectory)
    beyond = model.beyond_limits(trajectory.q)
    if csv or parquet:
        _write(model, trajectory, response, csv, parquet)
    if as_json:
        closure = {"residual_m": trajectory.residual, "condition": trajectory.condition, "branch": trajectory.branch}
        emit_json(
            {"mechanism": model.name, "motion": motion, "samples": len(samples.time), "closure": closure}
            | {"beyond_limits": {joint: list(reached) for joint, reached in beyond.items()}}
            | summary(response)
        )
        sys.exit(EXIT_WITH_FINDINGS if beyond else 0)
    peak = response.peak()
    rows = [[label(name), f"{value:.4g}", f"{peak[name]:.4g}"] for name, value in response.rms().items()]
    emit_table(f"{model.name}, motion {motion}", ["component", "RMS", "peak"], rows)
    click.echo(
        f"{len(samples.time)} samples over {samples.time[-1]:.4g} s; loops closed to {trajectory.residual:.2g} m "
        f"on the branch of {trajectory.branch!r}; weight excluded from force and moment."
    )
    for joint, (low, high) in beyond.items():
        least, most = model.limits[model.coordinate_index(joint)]
        click.echo(
            f"Joint {joint} goes from {low:.4g} to {high:.4g}, beyond the file's limits, {least:.4g} to {most:.4g}: "
            "the motion is computed as if it had none."
        )
    if not response.torque:
        click.echo("No drive torque: the file has no <actuator> that says which joints are driven.")
    sys.exit(EXIT_WITH_FINDINGS if beyond else 0)


def _write(
    model: "Mechanism", trajectory: "Trajectory", response: "Response", csv: str | None, parquet: str | None
) -> None:
    """Time series with units in the column names."""
    from ..table_files import write_csv_file, write_parquet

    columns = {"time_s": response.time} | response.columns()
    for joint, q, v, a in zip(model.coordinates, trajectory.q.T, trajectory.v.T, trajectory.a.T, strict=True):
        unit = "rad" if model.tree.joints[model.coordinates.index(joint)].revolute else "m"
        columns |= {f"q_{joint}_{unit}": q, f"v_{joint}_{unit}_per_s": v, f"a_{joint}_{unit}_per_s2": a}
    if csv:
        write_csv_file(csv, columns, "# origin: simulated\n")
    if parquet:
        write_parquet(parquet, columns, {"origin": "simulated"})
