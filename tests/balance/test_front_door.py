"""What a person at Python's prompt may ask of `import balance` by mistake: refused, not answered otherwise."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import balance
from balance.datasets import find_dataset
from balance.errors import CounterpoiseError
from balance.mechanism.mjcf_parser import mechanism_from_text

from . import models
from .cli.conftest import call

ASKED = [
    (lambda: balance.size("four-bar", objective={"moment": 1.0}), "moment is of a motion"),
    (lambda: balance.size("four-bar", "four-bar", objective={"noise": 1.0}), "'noise' of weight 1: expected force"),
    (lambda: balance.size("four-bar", "four-bar", objective={"force": 1.0, "moment": -1.0}), "'moment' of weight -1"),
    (lambda: balance.size("four-bar", "four-bar", objective={"force": np.nan}), "'force' of weight nan"),
    (lambda: balance.size("four-bar", "four-bar", objective={"vibration": 1.0}), "vibration and a rig"),
    (lambda: balance.size("four-bar", "four-bar", rig="parallelogram-6bar"), "vibration and a rig"),
    (lambda: balance.size("four-bar", added=np.nan), "nan kg may be added in all: expected zero or more"),
    (lambda: balance.size("four-bar", best=3), "best 3: several sets are of plates"),
    (lambda: balance.check("four-bar", {"counter_A0A": -1.0}), "'counter_A0A' is -1 kg"),
    (lambda: balance.check("four-bar", {"counter_A0A": np.inf}), "'counter_A0A' is inf kg"),
    (lambda: balance.sweep("four-bar", "four-bar", {"AB.mass": [-1.0]}), "AB.mass: expected finite values"),
    (lambda: balance.sweep("four-bar", "four-bar", {"B_AB.x": [np.nan]}), "B_AB.x: expected finite values"),
    (lambda: balance.sweep("four-bar", "four-bar", {"AB.mass": []}), "AB.mass: expected finite values"),
    (lambda: balance.sweep("four-bar", "four-bar", {}), "nothing is varied"),
    (lambda: balance.tolerance("four-bar", "four-bar", {"AB.mass": -0.1}), "tolerances of more than zero"),
    (lambda: balance.tolerance("four-bar", "four-bar", {"AB.mass": 0.1}, draws=0), "one draw at least"),
    (lambda: balance.tradeoff("four-bar", "four-bar", points=0), "0 points: expected a whole number, 4 at least"),
    (lambda: balance.tradeoff("four-bar", "four-bar", points=4.5), "4.5 points: expected a whole number, 4 at least"),
    (
        lambda: balance.tradeoff("four-bar", "four-bar", added="-1 kg"),
        "-1 kg may be added in all: expected zero or more",
    ),
    (
        lambda: balance.write_report(balance.size("four-bar"), "report.html"),
        "shows a motion: size the counter-masses on",
    ),
    (lambda: balance.write_report(balance.size("four-bar"), "report.pdf"), "expected a name ending in .html"),
    (
        lambda: balance.animate("four-bar", "four-bar", "a.gif"),
        "a.gif: expected a name ending in .html or .mp4 or .png",
    ),
    (lambda: balance.animate("four-bar", "four-bar", "no/a.svg"), "no/a.svg: there is no folder no"),
    (lambda: balance.engine("in-line-4", orders=0), "one order at least"),
    (lambda: balance.influence("two-plane-maker", "least"), "method: 'least': expected least-squares, robust, min-max"),
    (
        lambda: balance.size("four-bar", 3),
        "motion: of type int: expected a shipped name, a file, or what balance.load_mot",
    ),
    (lambda: balance.sweep("four-bar", balance.follow("four-bar", "four-bar"), {"AB.mass": [1]}), "takes a Trajectory"),
    (lambda: balance.load("a" * 5000), "a{60}...: File name too long"),
]


@pytest.mark.parametrize(("ask", "message"), ASKED, ids=[message for _, message in ASKED])
def test_what_cannot_be_meant_is_refused(ask, message) -> None:
    """By one line that names it; some of these were answered as if nothing had been asked."""
    with pytest.raises(CounterpoiseError, match=message) as refused:
        ask()
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("ask", [
    lambda motion: balance.simulate("four-bar", motion).table(),
    lambda motion: balance.size("four-bar", motion).table(),
    lambda motion: balance.sweep("four-bar", motion, {"AB.mass": [1.0, 2.0]}).table(),
    lambda motion: balance.tradeoff("four-bar", motion, points=4).table(),
    lambda motion: balance.tolerance("four-bar", motion, {"AB.mass": 0.1}, draws=10).table(),
    lambda motion: balance.methods("four-bar", motion).table(),
    lambda motion: balance.animate("four-bar", motion, "a.svg").name,
])  # fmt: skip
def test_a_motion_is_a_name_a_file_or_what_was_loaded(ask, tmp_path, monkeypatch) -> None:
    """The same answer of all three."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "own.toml"
    file.write_text((find_dataset("four-bar", "motions", ".toml")).read_text("utf-8"), encoding="utf-8")
    expected, *found = (ask(motion) for motion in ("four-bar", file, balance.load_motion("four-bar")))
    assert all(np.array_equal(one, expected) or one.equals(expected) for one in found)


def test_what_python_writes_is_what_the_commands_write(tmp_path) -> None:
    """A report and an animation, letter for letter; an animation shows both designs."""
    written = [tmp_path / name for name in ("report.html", "moving.html")]
    sizing = balance.size("four-bar", "four-bar", sites=["counter_A0A"])
    assert balance.write_report(sizing, written[0]) == written[0]
    assert balance.animate("four-bar", "four-bar", written[1], {"counter_A0A": "1 kg"}) == written[1]
    by_python = [path.read_text(encoding="utf-8") for path in written]
    call("report", "four-bar", "--motion", "four-bar", "--site", "counter_A0A", "-o", written[0])
    call("animate", "four-bar", "--motion", "four-bar", "-c", "counter_A0A=1kg", "-o", written[1])
    assert by_python == [path.read_text(encoding="utf-8") for path in written]
    assert "with counter-masses" in by_python[1]


_TURNS = {"x-y": np.eye(3), "x-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "y-z": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}
"""Columns are the base's axes of a machine in that plane, written in those of the machine in x-y."""


@cache
def _asked_of(text: str) -> dict[str, Any]:
    """Sizes, with plates as drawn too, and what a machine that carries them exerts on its base."""
    machine = mechanism_from_text(text, "machine")
    everything = {"force": 1.0, "moment": 0.5, "torque": 0.5}
    sizes = {
        stock: balance.size(machine, "four-bar", stock, objective=everything, limits={"counter_B0B": "6 kg"}).best
        for stock in (None, "example-plates")
    }
    exerted = balance.simulate(sizes["example-plates"].after, "four-bar", rate="500 Hz")
    return {
        "masses": [[one.mass for one in each.counter_masses] for each in sizes.values()],
        "inertia": [each.added_inertia for each in sizes.values()],
        "left": [each.remaining_percent() for each in sizes.values()],
        "force": exerted.force, "moment": exerted.moment, "torque": exerted.torque["A0"],
    }  # fmt: skip


@pytest.mark.parametrize(("plane", "seed"), [("x-z", 0), ("y-z", 0), ("x-y", 3), ("x-z", 4)])
def test_results_do_not_depend_on_the_axes_in_which_a_machine_is_written(plane, seed) -> None:
    """Its plane, and with a seed the frames of its bodies; to rounding of some 1e-12."""
    radii = "".join(
        f'<numeric name="{site}.radius_of_gyration" data="0.04"/>' for site in ("counter_A0A", "counter_B0B")
    )
    text = balance.load("four-bar").text.replace("<custom>", f"<custom>{radii}")
    turn = np.array(_TURNS[plane], float)
    expected, found = _asked_of(text), _asked_of(models.reframed(text, turn, seed))
    for name, values in expected.items():
        values = values @ turn if name in ("force", "moment") else values
        np.testing.assert_allclose(found[name], values, rtol=1e-8, atol=1e-9, err_msg=name)


SHOWN = [
    lambda: balance.load("four-bar"),
    lambda: balance.conditions("four-bar"),
    lambda: balance.follow("four-bar", "four-bar", rate="1 kHz"),
    lambda: balance.simulate("four-bar", "four-bar", rate="1 kHz"),
    lambda: balance.size("four-bar"),
    lambda: balance.rotor("three-masses"),
    lambda: balance.linkage("two-levels"),
    lambda: balance.engine("in-line-4", orders=2)[0],
    lambda: balance.drive("four-bar-dc")[0],
]


@pytest.mark.parametrize("ask", SHOWN)
def test_a_prompt_shows_what_one_can_read(ask) -> None:
    """A few lines that fit a window; not a file's text, not all fields."""
    lines = repr(ask()).splitlines()
    assert len(lines) <= 50
    assert max(map(len, lines)) <= 500
