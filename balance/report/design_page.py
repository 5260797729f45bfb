"""The report of a design as one page: counter-masses, what remains, conditions, a motion with and without them."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..balancing.nested_sizing import NestedSizing
from ..balancing.sizing import Sizing, sizing_document
from ..balancing.sizing_study import SizingStudy
from ..balancing.sweep import Problem
from ..balancing.tolerance import Tolerance, ToleranceAnalysis, analyze_tolerances
from ..dynamics.inverse_dynamics import Response, compared, simulate
from ..figures.balancing import draw_responses, draw_tolerances, titled
from ..results import document as document_of_result
from .moving import moving
from .page import Page, document_of, inline_svg
from .plotted import PlottedRun, plotted, spans_for

KINDS = {"F": "Shaking force", "M": "Shaking moment", "t": "Torque of the drives", "d": "Force of the drives"}
"""Headings by the first letter of a component's name."""
SECTIONS = (
    ("sizing", "Counter-masses"), ("conditions", "Conditions"), ("forces", "Forces, moments, torques"),
    ("tolerances", "Tolerances"), ("motion", "The mechanism"), ("series", "Time series"),
    ("provenance", "Provenance"),
)  # fmt: skip
DRAWS, SEED = 20_000, 1
"""Mechanisms that are drawn within tolerances, and the seed."""


def design_page(study: SizingStudy | NestedSizing, tolerances: Sequence[Tolerance] = ()) -> Page:
    """The page of counter-masses and of their motion with and without them; ``study`` is of a motion.

    Each of several payloads has its part, with what mechanisms made within ``tolerances`` keep.
    """
    trajectory = study.trajectory
    assert study.motion is not None
    assert trajectory is not None
    motion, sets = Path(study.motion).name, study.sets if isinstance(study, NestedSizing) else (study.best,)
    responses = [{name: simulate(getattr(one, name), trajectory) for name in ("before", "after")} for one in sets]
    analyses = [_within(tolerances, one, trajectory.samples) for one in sets] if tolerances else []
    document = _document(study, sets, responses, analyses)
    count = sum(len(one["responses"]) for one in document["payloads"])
    spans = spans_for([len(trajectory.time)] * 2 * count)
    runs, motions, parts = list[PlottedRun](), list[dict[str, Any]](), list[dict[str, Any]]()
    for k, (one, answers, of) in enumerate(zip(sets, responses, document["payloads"], strict=True)):
        carried, shown = _text([one.before.carried]), _components(of["responses"])
        name = f"{motion}, {carried}" if len(sets) > 1 else motion
        masses = {at.site: at.mass for at in one.counter_masses if at.mass > 0.0}
        designs = {"without counter-masses": (one.before, {}), "with counter-masses": (one.after, masses)}
        forces = {label: answer.force for label, answer in zip(designs, answers.values(), strict=True)}
        runs += [
            plotted_response(name, f"motion {name}, {label}", side == "after", answer, shown, spans)
            for label, (side, answer) in zip(designs, answers.items(), strict=True)
        ]
        motions.append(moving(name, trajectory, designs, forces))
        about = "Forces, moments and torques with and without counter-masses"
        part: dict[str, Any] = {"title": carried, "figure": inline_svg(draw_responses(answers, shown), about)}
        if analyses:
            part["within"] = analyses[k]
            part["shares"] = inline_svg(draw_tolerances(analyses[k]), "Share of each tolerance in what errors add")
        parts.append(part)
    filed = [name for name in sets[0].before.carried if name not in sets[0].before.payload]
    return Page(
        Path(__file__).with_name("design.html"),
        document,
        {"runs": [run.as_dict() for run in runs], "motions": motions},
        {
            "sections": [one for one in SECTIONS if analyses or one[0] != "tolerances"],
            "payload": _text([one.before.carried for one in sets]), "filed": filed, "of_parts": parts,
            "mounted": [_mounted(one) for one in (sets[:1] if document["one_set"] else sets)],
            "motion": motion, "coarse": trajectory.coarse, "made_small": study.made_small, "allowed": study.allowed,
            "given": study.given,
            "doubts": [said for one in analyses for said in one.doubts],
            "titled": _titled, "draws": f"{DRAWS:,}", "seed": SEED,
            "stock": Path(study.stock).name if study.stock else "",
        },
    )  # fmt: skip


def _document(
    study: SizingStudy | NestedSizing,
    sets: Sequence[Sizing],
    responses: Sequence[Mapping[str, Response]],
    analyses: Sequence[ToleranceAnalysis],
) -> dict[str, Any]:
    """What the page shows, units in the keys; under ``sizing`` as `balance size --json` has it."""
    verdict, *rest = str(study).splitlines()
    proof = [study.proof] if isinstance(study, NestedSizing) else []
    payloads, mounted = list[dict[str, Any]](), dict[str, float]()
    for k, (one, answers) in enumerate(zip(sets, responses, strict=True)):
        found, of = one.conditions, sizing_document(one)
        values = zip(found.values(one.before), found.values(one.after), found.units, strict=True)
        for row in of["counter_masses"]:
            row["added_kg"] = row["mass_kg"] - mounted.get(row["site"], 0.0)
            mounted[row["site"]] = row["mass_kg"]
        of |= {
            "payload_kg": one.before.carried,
            "remaining_percent": 0.0 if one.is_complete() else one.remaining_percent(),
            "moving_mass_kg": {"before": one.before.total_mass, "after": one.after.total_mass},
            "conditions": [
                {"condition": found.text(i), "unit": unit, "before": float(before), "after": float(after)}
                for i, (before, after, unit) in enumerate(values)
            ],
            "responses": compared(answers),
        }
        if analyses:
            of["tolerance"] = {"draws": DRAWS, "seed": SEED, **document_of_result(analyses[k])}
        payloads.append(of)
    return document_of({
        "schema_version": 2,
        "mechanism": study.sets[0].before.name,
        "motion": study.motion,
        "stock": study.stock,
        "software": {"name": "counterpoise", "version": version("counterpoise")},
        "inputs": [one._asdict() for one in study.files],
        "verdict": verdict,
        "proof": " ".join([*(line for line in rest if not line.startswith(" ")), *proof]),
        "sizing": study.document(),
        "one_set": len(sets) == 1 or (isinstance(study, NestedSizing) and study.fixed),
        "payloads": payloads,
    })  # fmt: skip


def _within(tolerances: Sequence[Tolerance], one: Sizing, samples: Any) -> ToleranceAnalysis:  # noqa: ANN401
    masses = {at.site: at.mass for at in one.counter_masses}
    return analyze_tolerances(Problem(one.before, samples, masses), tolerances, DRAWS, SEED)


def _text(payloads: Sequence[Mapping[str, float]]) -> str:
    """Bodies with their masses: ``fixture 0.9 kg``, of several payloads ``fixture 0.9 / 2.3 kg``."""
    names = dict.fromkeys(name for one in payloads for name in one)
    each = {name: dict.fromkeys(f"{one[name]:.6g}" for one in payloads if name in one) for name in names}
    return ", ".join(f"{name} {' / '.join(masses)} kg" for name, masses in each.items())


def _mounted(one: Sizing) -> str:
    return ", ".join(f"{at.site} {at.mass:.4f} kg" for at in one.counter_masses if at.mass > 0.0) or "none"


def _components(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Those of the rows that are drawn over time: all but that of the force vector."""
    return [row["component"] for row in rows if row["component"] != "F_N"]


def _titled(component: str) -> str:
    """A component with its unit: ``Fx [N]``; of the force vector ``|F| [N]``."""
    return "{} [{}]".format(*titled("|F|_N" if component == "F_N" else component))


def plotted_response(
    name: str, label: str, balanced: bool, response: Response, shown: Sequence[str], spans: int
) -> PlottedRun:
    """Components of a response, those ``shown``, for the page, in ``spans`` spans."""
    columns = response.columns()
    channels = (plotted(KINDS[one[0]], *titled(one), response.time, np.asarray(columns[one]), spans) for one in shown)
    return PlottedRun(name, label, balanced, tuple(channels))
