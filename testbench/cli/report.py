"""``testbench report``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from balance.cli.framework import Answer, Read, Word, argument, command, option
from balance.cli.options import SCHEDULER
from balance.cli.printing import Detail, cells, emit_parts, emit_table, json_text, say
from balance.results import NO_VALUE

from ..signal import METRIC_NAMES
from . import options

if TYPE_CHECKING:
    from ..report import RunReport
    from ..signal import Metric
    from ..signal.filters import Band

PARTS = (
    "motions.found", "command.axes", "command.encoder_noise", "modes.modes", "response.rows", "wrench.components",
    "torque.drives", "torque.definitions",
)  # fmt: skip
"""What of a run's report is printed for who asks for everything."""
_VIBRATION = {
    "sensor": "sensor", "axis": "component", "peak": "peak_m_s2:.4g", "peak to peak": "peak_to_peak_m_s2:.4g",
    "RMS": "rms_m_s2:.4g", "spectrum peaks [Hz]": "peaks",
}  # fmt: skip


def print_report(found: "RunReport") -> None:
    """Print a run's report: its largest vibration, the vibration of the base, what is unknown and why, findings.

    With --all also its other parts, from its document.
    """
    from ..figures.style import condition_of, origin_of

    about = dict.fromkeys([found.run.name, condition_of(found.run)])
    axes = found.parts["vibration"].get("axes", ())
    strongest = max(axes, key=lambda axis: axis["peak_to_peak_m_s2"], default=None)
    largest = "vibration of the base unknown"
    if strongest:
        largest = f"base {strongest['peak_to_peak_m_s2']:.4g} m/s2 peak to peak along {strongest['component']}"
    say(f"{origin_of([found.run])}{': '.join(about)}: {largest}; {len(found.findings)} findings.")
    if strongest:
        peaks = [", ".join(f"{p['frequency_hz']:.1f}" for p in axis["spectrum_peaks"]) or NO_VALUE for axis in axes]
        rows = [{**axis, "peaks": text} for axis, text in zip(axes, peaks, strict=True)]
        definitions = "; ".join(found.parts["vibration"]["definitions"].values())
        emit_table("Vibration of the base [m/s2]", *cells(rows, _VIBRATION), definitions)
    for name, part in found.parts.items():
        if "reason" in part:
            say(f"No {name}: {part['reason']}")
    for source, reason in found.parts["motions"].get("reasons", {}).items():
        say(f"No motion by {source}: {reason}")
    options.print_findings(found.findings)
    if Detail.everything:
        emit_parts(found.as_dict(), PARTS)
    say("")


def _point(text: str) -> tuple[float, ...]:
    """``X,Y,Z``, each with a unit of length."""
    from balance.units import parse

    parts = text.split(",")
    if len(parts) != 3:
        raise ValueError(f"{text!r}: expected three lengths such as 0m,-0.1m,25mm")
    return tuple(parse(part.strip(), "length") for part in parts)


@command(
    epilog="""\b
Examples:
  testbench report campaign/r001.h5
  testbench report campaign -o figures
  testbench report campaign -o report.html --published kiper2019
  testbench report campaign/r001.h5 --at 0m,-0.1m,0m --band 1..100 --json
\b
Exit codes: 0 done, 3 done with findings (a clipped or dead sensor, a motion or torque not the run table's), 1
some run was refused (the others are reported)."""
)
def report(
    runs: tuple[Path, ...] = argument("RUN|CAMPAIGN...", required=True),
    point: tuple[float, float, float] = option(
        "The point of the base that moments are about.", Read("x,y,z", _point), "--at", default="0m,0m,0m"
    ),
    band: "Band | None" = option(
        "Of vibration and forces [Hz], by a Butterworth filter of order 4, forwards and backwards; none: all.",
        options.BAND_TEXT,
        default="0..200",
    ),
    bandwidth: float = options.frequency("Of accelerations from encoders and of torques [Hz].", default=80.0),
    mechanism: str | None = option("A mechanism in place of the one that the rig names.", metavar="MECH"),
    published: str | None = option("On the page: published reductions, kiper2019 or a file.", metavar="NAME"),
    metric: "Metric" = option(
        "On the page: what an amplitude is whose reduction is shown.", Word(METRIC_NAMES), default="peak_to_peak"
    ),
    accept: tuple[str, ...] = options.ACCEPT,
    scheduler: str | None = SCHEDULER,
    output: Path | None = option(
        "A name ending in .html: one page of all runs, to sign and mail. Else a folder for figures and report.json.",
        None,
        "-o",
        "--output",
    ),
) -> Answer:
    """What each RUN tells by itself, every number with its definition, and for what is not known the reason.

    Motions found (x, y, triangle; by command, encoders, acceleration); how well the command was reached; vibration of
    the base, its modes from the free decay, its response to the shaking force; force and moment at a point; torques
    against the model. With --output also figures: each run, and runs with counter-masses beside those without.

    With -o report.html one page, readable without network or script: reductions with intervals (as testbench compare),
    what would balance it (trim), the mechanism moving with the log, time series, cross-examination, findings,
    uncertainty, digests. Reductions are of 1..200 Hz unless --band is given.
    """
    from balance.task_pool import task_pool

    from ..figures.style import origin_of
    from ..report import Reporting
    from ..report.campaign_page import torques_compared
    from ..report.run_report import draw
    from ..vibration.metrics import Measure

    if output and output.suffix.lower() == ".html":
        given = click.get_current_context().get_parameter_source("band") is not ParameterSource.DEFAULT
        measure = Measure(metric, band) if given else Measure(metric)
        return _page(runs, output, scheduler, measure=measure, published=published, accept=accept,
                     mechanism=mechanism, point=point, band=band, bandwidth_hz=bandwidth)  # fmt: skip
    if published:
        raise click.UsageError("--published is shown on the page: give it with -o report.html")
    if output and output.is_file():
        raise click.UsageError(f"--output {output}: is a file; expected a folder, or a name ending in .html")
    opened, refused = options.openable_runs(runs)
    with task_pool(scheduler, tasks=len(opened)) as pool:
        _, found, unread = Reporting(point, band, bandwidth, mechanism).runs(opened, accept, pool)
    refused += [options.NotOpened(run, message) for run, message in unread.items()]
    compared = torques_compared(opened, found)
    document = {
        "runs": [one.as_dict() for one in found.values()],
        "compared": compared,
        **options.provenance(opened),
        "refused": refused,
    }
    written = []
    if output and opened:
        output.mkdir(parents=True, exist_ok=True)
        written = [*draw(opened, output, mechanism, bandwidth), output / "report.json"]
        written[-1].write_text(json_text(document) + "\n", encoding="utf-8")

    def show() -> None:
        if len(found) > 1:
            number = sum(len(one.findings) for one in found.values())
            say(f"{origin_of([one.run for one in found.values()])}{len(found)} runs, {number} findings.\n")
        for one in found.values():
            print_report(one)
        for path in written:
            say(f"Wrote {path}.")
        options.print_provenance(opened)

    document["written"] = [str(path) for path in written]
    has_finding = any(one.findings for one in found.values())
    return Answer(document, show, has_finding, refused=refused, further=("compared",))


def _page(runs: tuple[Path, ...], output: Path, scheduler: str | None, **how: Any) -> Answer:  # noqa: ANN401
    """One page of all runs; on stdout its verdict, or the document that its numbers are from."""
    from balance.report.page import writable
    from balance.task_pool import task_pool

    from ..published_tables import load_published
    from ..report import campaign_report

    writable(output)
    name, opened, refused = options.runs_shown(runs)
    how["published"] = load_published(how["published"]) if how["published"] else None
    unopened = {one.run: one.message for one in refused}
    with task_pool(scheduler, tasks=len(opened)) as pool:
        found = campaign_report(name, opened, unopened=unopened, pool=pool, **how)
    page = found.page()
    path, findings = page.write(output), page.document["findings"]

    def show() -> None:
        say(f"{name}: {page.document['verdict']}")
        for finding in findings:
            more = f" (and {finding['count'] - 1} more)" if finding["count"] > 1 else ""
            say(f"  {finding['code']}: {finding['messages'][0]}{more}; {finding['decision']}")
        say(f"Wrote {path}.")

    document = {**page.document, "refused": refused, "written": [str(path)]}
    return Answer(document, show, bool(findings), refused=refused)
