"""What the sensors' stated errors leave open: one value a campaign, the same in all blocks, so that none shows it.

A sensor shows A s of what it is exposed to, A near one: where its calibration states the uncertainty of its
sensitivity, or the rig how far its entries scatter (``bench.errors``: sensitivity, cross-talk), each entry changes the
readings by what it is exposed to. It is an unknown of which that scatter is known: jointly estimated, as near to zero
as the scatter says. What of it the fit does not see goes by the gain of the least squares into what is found; entries
are independent, their variances add (JCGM 100, 5.1.2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from balance.arrays import Floats
from balance.estimation.first_moment_imbalance import ImbalanceFit
from balance.estimation.regression import RegressionRecord

from ..rig import Column
from ..rig.sensor_channels import sensitivity_scatter
from ..rig.sensors import Support
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from .problem import Effects, Entry, RunEquations


def stated_deviations(run: SIRun) -> dict[Entry, float]:
    """Standard deviations of the entries that a run's calibrations and rig state, zero ones left out."""
    found: dict[Entry, float] = {}
    for name, errors in run.rig.bench.errors.items():
        if name in run.rig.sensors:
            sizes = sensitivity_scatter(name, list(run.rig.sensors[name].columns(name)), errors)
            found |= {(name, int(j), int(k)): float(sizes[j, k]) for j, k in np.argwhere(sizes > 0.0)}
    for column in run.rig.columns():
        if run.holds(column) and (stated := run.sensitivity_uncertainty(column)) is not None:
            found[column.sensor, column.index, column.index] = stated.relative
    return found


def with_error_columns(
    records: Sequence[RegressionRecord],
    effects: Sequence[Effects],
    deviations: Sequence[Mapping[Entry, float]],
    explained: Sequence[Effects] | None = None,
) -> tuple[list[RegressionRecord], list[Entry]]:
    """Records with a shared column for each entry that changes one, and those entries.

    In each record it is per standard deviation of the entry in that run: one may be calibrated better than another.
    Instruments of a record are what is ``explained`` of its effects, where that is given, and else its columns.
    """
    entries = sorted({entry for one in effects for entry in one})
    if not entries:
        return list(records), []
    joined = []
    for record, one, own, told in zip(records, effects, deviations, explained or [{}] * len(records), strict=True):
        columns, instruments = (
            np.stack([own[e] * of[e] if e in of else np.zeros_like(record.readings) for e in entries], axis=2)
            for of in (one, {**one, **told})
        )
        wider = replace(record, columns=np.concatenate([record.columns, columns], axis=2))
        if told:
            wider = replace(wider, instruments=np.concatenate([record.columns, instruments], axis=2))
        joined.append(wider)
    return joined, entries


def error_covariance(found: ImbalanceFit, records: Sequence[RegressionRecord], count: int) -> Floats:
    """Of the conditions' values, (rank, rank) [kg2 m2], by the last ``count`` columns of the records."""
    moved = sum(
        np.einsum("njk,nje->ke", gain, record.columns[:, :, -count:])
        for gain, record in zip(found.gains(), records, strict=True)
    )
    return np.asarray(moved @ np.transpose(moved))


def reading_effects(exposed_to: Floats, columns: Sequence[Column], deviations: Mapping[Entry, float]) -> Effects:
    """Effects on readings that are compared channel by channel, of what the channels are exposed to (n, channels).

    That is what explains the readings, and not they: their noise would seem to be explained by the sensitivities.
    """
    found: dict[Entry, Floats] = {}
    for name, shows, exposed in deviations:
        places = {column.index: place for place, column in enumerate(columns) if column.sensor == name}
        if shows in places and exposed in places:
            change = np.zeros_like(exposed_to)
            change[:, places[shows]] = exposed_to[:, places[exposed]]
            found[name, shows, exposed] = change
    return found


def force_effects(run: AlignedRun, deviations: Mapping[Entry, float], axes: Sequence[int]) -> Effects:
    """Effects on the supports' summed forces along ``axes``, on the run's grid."""
    found: dict[Entry, Floats] = {}
    for name, support in run.rig.supports.items():
        entries = [entry for entry in deviations if entry[0] == name]
        if not entries:
            continue
        columns = list(support.columns(name))
        shown = run.channels(columns)
        parted = support.crosstalk is not None and not run.run.has_matrix(columns[0])
        loads = np.linalg.inv(np.array(support.crosstalk)) if parted else np.eye(len(columns))
        for entry in entries:
            change = np.zeros((len(shown), len(axes)))
            for row, axis in enumerate(axes):
                if (component := f"F{'xyz'[axis]}") in support.measured:
                    change[:, row] = loads[support.measured.index(component), entry[1]] * shown[:, entry[2]]
            if change.any():
                found[entry] = change
    return found


def without_residual(run: RunEquations, residual: Floats, supports: Mapping[str, Support]) -> Effects:
    """Effects of the supports' errors on sums of their forces, of what the sensors are exposed to: what they show less
    an equal part each of the ``residual`` (n, rows) [N].

    With it the least squares would make forces, conditions and mass smaller together, and the residual with them.
    """
    found = dict(run.effects)
    for place, row in enumerate(run.record.rows):
        showing = {name: one.measured.index(row) for name, one in supports.items() if row in one.measured}
        for name, channel in showing.items():
            if (entry := (name, channel, channel)) in found:
                found[entry] = found[entry].copy()
                found[entry][:, place] -= residual[:, place] / len(showing)
    return found
