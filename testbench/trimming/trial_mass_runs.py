"""What runs with trial masses say of the balance conditions, from the vibration of a base of which nothing is known.

Runs differ by masses that the run table gives, and by their motions, which the encoders give; the base's
response to a push is measured with what is missing (see ``trial_mass_response``). What is missing is that of the first
run's mounting. A heavier mounting makes a heavier base: what the difference of the masses takes of the base's
accelerations is counted among the pushes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import null_space

from balance.balancing.conditions import Conditions
from balance.balancing.sizing import site_columns
from balance.dynamics.moving_base import locked_inertia
from balance.dynamics.regressor import wrench_regressor
from balance.estimation.first_moment_imbalance import Imbalance, Subspace
from balance.estimation.trial_mass_response import Trial, transform, transform_frequencies, trial_mass_imbalance
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics.gaps import GAP_FINDING, Gaps
from ..loads.shaking_wrench import refuse_clipped_base
from ..recording import Finding
from ..runs.aligned_run import AlignedRun
from .problem import TrimProblem, excited_combinations

CUTOFF_HZ = 30.0
"""Highest frequency of readings and pushes: the modes of a base on its mounts lie below."""
POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the readings."""
LEAST_EXCITATION = 1e-2
"""Of what turns the base without pushing it: combinations excited less, relative to the strongest, are the file's."""
PUSHES = 1e-6
"""Share of the largest component of the wrench below which one is none."""
LEAST_CHANGE = 0.02
"""Change of a site's mass by trial masses, as a part of the most that any site lacks without counter-masses."""
_ROUNDED = 1e-9
"""A trial mass at a site, as a part of the largest anywhere, that is rounding of the others."""


class _Seen:
    """One run before transforms: on the encoders' grid."""

    def __init__(self, run: AlignedRun, first: Mechanism, cutoff: float) -> None:
        base, model = run.base, run.mechanism
        if base is None:
            raise AnalysisError(f"{run.name}: no accelerometer on the base was recorded: nothing shows how it vibrates")
        refuse_clipped_base(run.run)
        path = run.trajectory(POSITION_BANDWIDTH * cutoff)
        self.time = run.grid.time - run.grid.time[0]
        self.reading = run.on_grid(base.group, base.time, base.values)
        self.wrench = wrench_regressor(model, path.q, path.v, path.a)
        heavier = locked_inertia(model, path.q[0]) - locked_inertia(first, path.q[0])
        self.known = self.wrench @ (model.pi - first.pi) - self.reading @ base.told.T @ heavier.T


def without_gaps(problem: TrimProblem) -> tuple[TrimProblem, tuple[Finding, ...]]:
    """The problem with the runs that are whole, and a finding for each with a gap: the base rings on through it.

    Raises AnalysisError if no run is whole.
    """
    whole, findings = [], []
    for run in problem.runs:
        groups = dict.fromkeys([run.reference, *([run.base.group] if run.base else [])])  # each on its own clock
        gaps = Gaps.of({group: run.run.time(group) for group in groups}).descriptions
        reason = "the run is left out, for the base rings on through a gap"
        findings += [Finding(GAP_FINDING, None, run.name, f"{run.name}: {text}: {reason}") for text in gaps]
        whole += [] if gaps else [run]
    if not whole:
        raise AnalysisError("no run can tell:\n" + "\n".join(f"  {finding.message}" for finding in findings))
    return replace(problem, runs=whole), tuple(findings)


def trial_mass_runs_imbalance(problem: TrimProblem, first: Mechanism, cutoff: float) -> Imbalance:
    """Values of the conditions of the mounting ``first``, in what masses at the problem's sites can change.

    Raises AnalysisError where trial masses do not differ at every site, NotIdentifiable or DataError where the runs
    cannot tell.
    """
    conditions, sites = problem.conditions, problem.sites
    refuse_dependent_masses(problem.runs, problem.mechanism, conditions, sites)
    seen = [_Seen(run, first, cutoff) for run in problem.runs]
    size = np.max([np.abs(one.wrench @ first.pi).max(axis=0) for one in seen], axis=0)
    rows = np.flatnonzero(size > PUSHES * size.max())
    own, rest = np.linalg.pinv(conditions.matrix), null_space(conditions.matrix)
    nuisance = rest @ excited_combinations([one.wrench[:, rows] @ rest for one in seen], LEAST_EXCITATION)
    at = transform_frequencies(max(float(one.time[-1]) for one in seen), cutoff)
    fixed, basis = first.pi - own @ conditions.values(first), np.hstack([own, nuisance])
    trials = []
    for one in seen:
        wrench = one.wrench[:, rows]
        slow = np.stack([np.ones_like(one.time), one.time - one.time.mean()], axis=1)
        shown = (wrench @ basis, one.known[:, rows] + wrench @ fixed, one.reading, slow)
        trials.append(Trial(*(transform(values, one.time, at) for values in shown)))
    free = Subspace.at_sites(conditions, first, sites)
    return trial_mass_imbalance(trials, at, conditions, conditions.values(first), free)


def refuse_dependent_masses(
    runs: Sequence[AlignedRun], mechanism: Mechanism, conditions: Conditions, sites: Sequence[str]
) -> None:
    """Raise AnalysisError, naming the sites, where trial masses do not tell the sites apart."""
    for run in runs:
        if "counter_masses" not in run.conditions:
            raise AnalysisError(
                f"{run.name}: its conditions do not say which masses were mounted: put counter_masses into the "
                "run table (also where nothing is mounted) and ingest with --runs"
            )
    first = runs[0].mechanism
    values = np.array([conditions.values(run.mechanism) - conditions.values(first) for run in runs])
    columns = site_columns(conditions, first, sites)
    masses = np.linalg.lstsq(columns, values.T, rcond=None)[0]
    lacking = np.linalg.lstsq(columns, -conditions.values(mechanism), rcond=None)[0]
    least = LEAST_CHANGE * np.abs(lacking).max(initial=0.0)
    masses[np.abs(masses) < _ROUNDED * np.abs(masses).max(initial=0.0)] = 0.0
    alike = []
    for i, site in enumerate(sites):
        others = np.delete(masses, i, axis=0)
        apart = masses[i] - (masses[i] @ np.linalg.pinv(others)) @ others if len(others) else masses[i]
        if np.ptp(apart) < max(least, 1e-12):
            alike.append(site)
    if alike:
        names, there = " and ".join(alike), "there" if len(alike) == 1 else "at each"
        raise AnalysisError(
            f"{', '.join(run.name for run in runs)}: what is mounted differs from run to run, so that they are "
            f"taken for runs with trial masses, but the mass at {names} does not differ independently of the "
            f"others: what is missing there is not determined; mount at least {least:.2g} kg more or less {there} in "
            "some runs alone, or name runs of one mounting alone"
        )
