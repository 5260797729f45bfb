"""``testbench calibrate``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, Answer, argument, command, option
from balance.cli.printing import emit_table, plain_text, say
from balance.results import document, table

from . import options
from .options import NotOpened

if TYPE_CHECKING:
    from ..calibration.definition import Calibration
    from ..store import Run


def _each_axis(text: str, what: str = "TEXT", **attributes: Any) -> Any:  # noqa: ANN401
    """An option for all axes, or given for each."""
    return option(text, metavar=f"{what}|AXIS={what}", multiple=True, **attributes)


_OPTIONS = {
    "sensitivity": _each_axis("Such as '10.2 mV/g' or 'Fx=3.9 pC/N'."),
    "amplifier": _each_axis("Amplifier behind the sensor: '10 mV/pC' or '100 pC/V'."),
    "offset": _each_axis("What it shows at zero: '2.5 V' or '-0.6 N'."),
    "polynomial": option("Coefficients from --raw to --physical, the constant first.", metavar="C0,C1,..."),
    "matrix": option("CSV: a row a component, a column a channel.", click.Path(path_type=Path), metavar="FILE"),
    "raw": option("The unit that a polynomial or matrix takes.", metavar="UNIT"),
    "physical": _each_axis("The unit that a polynomial or matrix gives.", "UNIT"),
    "certificate": _each_axis("A digital calibration certificate (DCC, XML).", "FILE"),
    "quantity": _each_axis("Part of the name that a certificate gives the sensitivity, if it has several."),
    "frequency": option("Which to take of a certificate with several frequencies.", float, metavar="HZ"),
    "uncertainty": _each_axis("Of the sensitivity: '1 %' or '0.1 mV/g'."),
    "coverage_factor": option("Of --uncertainty, as certificates state it, such as 2.", float, metavar="K"),
    "unit": option("Unit in which the logger wrote, where neither log nor rig states it.", metavar="UNIT"),
    "date": option("When the sensor was calibrated.", metavar="YYYY-MM-DD"),
    "reference": option("Certificate, laboratory.", metavar="TEXT", default="", show_default=False),
    "reason": option("Why it is corrected; it must be given.", metavar="TEXT"),
    "listed": option(
        "Which calibration is in force for which run, and all that were recorded.", None, "--list", is_flag=True
    ),
}


@command(
    given=_OPTIONS,
    epilog="""\b
Examples, for logs in physical units, such as those of testbench simulate:
  testbench calibrate campaign base_acc --sensitivity "1.02 g/g" --reason "shows 2 % too much, certificate of March"
  testbench calibrate campaign/r001.h5 campaign/r002.h5 kistler --offset "x=-0.6 N" --reason "was not zeroed"
  testbench calibrate campaign --list
And for logs in volts or mV/V:
  testbench calibrate campaign acc --sensitivity "10.2 mV/g" --reason "certificate of March"
  testbench calibrate campaign/r001.h5 acc --sensitivity "x=10.2 mV/g" --sensitivity "y=9.9 mV/g" --reason "..."
  testbench calibrate campaign force --sensitivity "3.9 pC/N" --amplifier "100 pC/V" --reason "range was 100 pC/V"
  testbench calibrate campaign six_axis --matrix cross.csv --raw mV/V --physical "F=N" --physical "M=N m" --reason "..."
  testbench calibrate campaign acc --certificate x=dcc-x.xml --certificate y=dcc-y.xml --frequency 16 --reason "..."
  testbench calibrate campaign acc --sensitivity "10.2 mV/g" --uncertainty "1 %" --coverage-factor 2 --reason "..."
  testbench calibrate campaign load --polynomial 0,250,1.3 --raw V --physical N --reason "dead weights, 5 points"
\b
Exit codes: 0 done, 3 done but for runs that are damaged, 1 refused (nothing recorded): no such sensor, units that do
not lead to what it measures, every run damaged.""",
)
def calibrate(
    words: tuple[str, ...] = argument("CAMPAIGN|RUN... SENSOR", required=True),
    **given: Any,  # noqa: ANN401
) -> Answer:
    """Correct the calibration of SENSOR in stored runs: a record in the campaign, dated, with a reason.

    It is in force from now on for those runs, instead of earlier records and the rig; the runs themselves never change.
    SENSOR is the name in the rig.
    """
    from ..runs.recalibrate import calibrate as correct

    if given["listed"]:
        return _list(*_runs(words))
    if len(words) < 2:
        raise click.UsageError("expected CAMPAIGN or RUN..., then SENSOR; or --list")
    reason = options.one_line("--reason", given["reason"])
    if not reason:
        raise click.UsageError("--reason is missing: a correction is recorded with why it was made")
    files, quantity, frequency = (given[name] for name in ("certificate", "quantity", "frequency"))
    if (files and given["sensitivity"]) or (not files and (quantity or frequency)):
        raise click.UsageError("--certificate gives the sensitivity; --quantity and --frequency go with it")
    typed = None if files else _calibration(given)
    runs, damaged = _runs(words[:-1])
    if not runs:
        return Answer({"refused": damaged}, lambda: None, refused=_left_out(damaged))
    calibration = typed or _calibration(given | _certified(files, quantity, frequency, runs[0], words[-1]))
    done = correct(runs, words[-1], calibration, reason)
    damaged += [NotOpened(name, message) for name, message in done.left_out.items()]

    def show() -> None:
        say(f"{words[-1]}: {calibration}, from now on for {', '.join(done.runs)}.")
        if not done.changes:
            say("It changes no reading: they are converted by it as they were before.")
        if done.without:
            say(f"Runs without this sensor: {', '.join(done.without)}.")
        say(f"Recorded in {plain_text(str(done.record))}.")

    found = {"record": str(done.record), "sensor": words[-1], "calibration": calibration.document(), "reason": reason}
    about = {"runs": list(done.runs), "changes_readings": done.changes, "runs_without_the_sensor": list(done.without)}
    return Answer(
        {**found, **about, "refused": damaged},
        show,
        refused=_left_out(damaged),
        code=EXIT_WITH_FINDINGS if damaged else 0,
    )


def _runs(words: tuple[str, ...]) -> "tuple[list[Run], list[NotOpened]]":
    """The runs that can be opened, and those that cannot. Raises StoreError for a path that does not exist."""
    from ..errors import StoreError
    from ..store import open_campaign

    given = [Path(word) for word in words]
    paths = [next((one for one in (p, p.with_name(f"{p.name}.h5")) if one.exists()), p) for p in given]
    for path in paths:
        if path.is_dir():
            open_campaign(path)  # says what is there instead of runs
        elif not path.exists():
            raise StoreError(f"{path}: no such file; expected a stored run (.h5), or a campaign's folder")
    return options.openable_runs(paths)


def _left_out(damaged: list[NotOpened]) -> list[str]:
    """Which runs were left out, and how to recover them."""
    return [
        f"{one.message}; {one.run} is left out: `testbench verify` tells if it is damaged; then `testbench "
        "remove` takes it out of the campaign: ingest its logs again, and calibrate it"
        for one in damaged
    ]


def _calibration(given: dict[str, Any]) -> "Calibration":
    """The calibration that the options describe; an error of the table is reported as one of the option."""
    from pydantic import ValidationError

    from ..calibration.definition import Calibration, read_matrix

    table: dict[str, Any] = {name: _each(given[name], name) for name in ("sensitivity", "amplifier", "offset")}
    table |= {name: given[name] for name in ("unit", "date", "reference")}
    if stated := _each(given["uncertainty"], "uncertainty"):
        factor = given["coverage_factor"]
        kind = "standard" if factor is None else "expanded"
        table["uncertainty"] = {kind: stated} | ({} if factor is None else {"coverage_factor": factor})
    elif given["coverage_factor"] is not None:
        raise click.UsageError("--coverage-factor goes with --uncertainty")
    units = {"raw": given["raw"], "physical": _each(given["physical"], "physical")}
    if (given["matrix"] or given["polynomial"]) and None in units.values():
        raise click.UsageError("--matrix and --polynomial need --raw and --physical: the units that they take and give")
    if given["polynomial"]:
        table["polynomial"] = units | {"coefficients": given["polynomial"].split(",")}
    elif not given["matrix"] and any(units.values()):
        raise click.UsageError("--raw and --physical go with --matrix or --polynomial")
    if given["matrix"]:
        table["matrix"] = units | {"rows": read_matrix(given["matrix"])}
    try:
        return Calibration.model_validate({key: value for key, value in table.items() if value is not None})
    except ValidationError as error:
        found = error.errors(include_url=False)[0]
        place = " ".join(f"--{part}" for part in found["loc"][:1])
        raise click.UsageError(f"{place} {found['msg'].removeprefix('Value error, ')}".strip()) from error


def _certified(
    files: tuple[str, ...], quantity: tuple[str, ...], frequency: float | None, run: "Run", sensor: str
) -> dict[str, Any]:
    """What certificates say of a sensor, as options; AXIS=FILE where each axis has one of its own."""
    from ..errors import RigError
    from ..runs.recalibrate import certified

    each, names = _each(files, "certificate"), _each(quantity, "quantity") or ""
    axes = each if isinstance(each, dict) else {"": each or ""}
    found = {}
    for axis, file in axes.items():
        name = names if isinstance(names, str) else names.get(axis, "")
        found[axis] = certified(run, sensor, Path(file), frequency, name)
    factors = {one.get("uncertainty", {}).get("coverage_factor") for one in found.values()}
    if len(factors) > 1:
        raise RigError("the certificates state uncertainties of different kinds or coverage factors: give one by one")

    def texts(key: str) -> tuple[str, ...]:
        stated = {axis: (one | one.get("uncertainty", {})).get(key) for axis, one in found.items()}
        return tuple(f"{axis}={text}" if axis else text for axis, text in stated.items() if text)

    return {
        "sensitivity": texts("sensitivity"),
        "uncertainty": texts("expanded") or texts("standard"),
        "coverage_factor": factors.pop(),
        "date": max(one.get("date", "") for one in found.values()) or None,
        "reference": "; ".join(dict.fromkeys(one["reference"] for one in found.values())),
    }


def _each(texts: tuple[str, ...], option: str) -> str | dict[str, str] | None:
    """``10.2 mV/g`` for all axes, or ``x=10.2 mV/g`` for each."""
    if not texts:
        return None
    parts = [text.partition("=") for text in texts]
    if len(parts) == 1 and not parts[0][1]:
        return texts[0].strip()
    if any(not equals or not axis.strip() for axis, equals, _ in parts):
        raise click.UsageError(f"--{option}: expected one text for all axes, or AXIS=TEXT for each")
    if len({axis.strip() for axis, _, _ in parts}) < len(parts):
        raise click.UsageError(f"--{option}: an axis is given twice")
    return {axis.strip(): text.strip() for axis, _, text in parts}


def _list(runs: "list[Run]", damaged: list[NotOpened]) -> Answer:
    from ..runs import calibration_history
    from ..runs.calibration_history import CalibrationInForce, CalibrationRecord

    in_force = options.calibrations(runs)
    folders, names = dict.fromkeys(run.path.parent for run in runs), {run.path.name for run in runs}
    every = [record for folder in folders for record in calibration_history.read_calibrations(folder)]
    records = [record for record in every if names & record.runs.keys()]
    # The runs for which each record is in force.
    used = [[run for one in in_force if one.source == record.record for run in one.runs] for record in records]

    def show() -> None:
        cells = table(CalibrationInForce, in_force, "sensor", "calibration", "since", "reason", "runs")
        none = "none: what the logs hold is taken to be in the physical units that they write"
        emit_table(f"Calibrations that hold: {len(in_force)}", *cells, "" if in_force else none)
        if records:
            header, rows = table(CalibrationRecord, records)
            states = [" ".join(["holds for", *some]) if some else "superseded" for some in used]
            emit_table("Recorded", [*header, ""], [[*row, state] for row, state in zip(rows, states, strict=True)])

    recorded = [document(r) | {"holds_for": some} for r, some in zip(records, used, strict=True)]
    shown = {"holds": in_force, "records": recorded, "refused": damaged}
    return Answer(shown, show, refused=_left_out(damaged), code=EXIT_WITH_FINDINGS if runs and damaged else 0)
