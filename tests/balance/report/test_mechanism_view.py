"""The view of a mechanism: its numbers are those of the commands, its names are text, its secret is nobody else's."""

import re
import webbrowser
from pathlib import Path
from threading import Thread
from urllib.parse import unquote, urlparse

import numpy as np
import pytest

from balance import datasets
from balance.cli import main
from balance.errors import CounterpoiseError
from balance.mechanism.mjcf_parser import load_mechanism
from balance.report.mechanism_view import SIDES, MechanismView
from balance.report.moving import pictures

from ...commands import call

HOSTILE = "<script>document.title='x'</script>\u202e{{7*7}}"
ESCAPED = HOSTILE.replace("<", "&lt;")


@pytest.fixture(scope="module")
def view():
    """Of a four-bar in its own motion."""
    return MechanismView(load_mechanism("four-bar"), ["four-bar"])


@pytest.fixture(scope="module")
def sized():
    """What the command that sizes prints of the same."""
    return call(main, "balance", "size", "four-bar", "--motion", "four-bar", "--json").json


def of_command(document, component, unit, kind):
    """A component of what a command prints."""
    group = document[kind]
    return group[f"{component}_{unit.replace(' ', '')}"] if component[0] in "FM" else group["torque_Nm"][component[7:]]


@pytest.mark.parametrize("masses", [None, (0.5, 3.0), (0.0, 0.0)])
def test_numbers_are_the_commands(view, sized, masses):
    """Peak and RMS of each component, without, as sized and as mounted, to rounding of the largest."""
    words = {} if masses is None else {f"mass{i}": f"{1000 * mass} g" for i, mass in enumerate(masses)}
    found = view.response(words)
    assert found["masses_kg"]["sized"] == [one["mass_kg"] for one in sized["counter_masses"]]
    mounted = found["masses_kg"]["mounted"]
    assert mounted == (found["masses_kg"]["sized"] if masses is None else list(masses))
    counter = [word for site, mass in zip(view.sites, mounted, strict=True) for word in ("-c", f"{site}={mass}kg")]
    simulated = call(main, "balance", "simulate", "four-bar", "--motion", "four-bar", *counter, "--json").json
    largest = max(max(row["peak"]) for row in found["responses"])
    assert len(found["responses"]) == 4
    for row in found["responses"]:
        for kind in ("rms", "peak"):
            expected = [
                of_command(one, row["component"], row["unit"], kind)
                for one in (sized["before"], sized["after"], simulated)
            ]
            assert row[kind] == pytest.approx(expected, rel=1e-9, abs=1e-12 * largest)
    assert set(found["rms_force_N"]) == set(SIDES)
    assert found["rms_force_N"][SIDES[0]] == pytest.approx(sized["rms_before_N"])


def test_the_centre_of_mass_rests_where_it_is_balanced(view):
    """With the counter-masses of balance size it is the same in all poses; without it moves."""
    sized = [f"{mass!r} kg" for mass in view.response({})["masses_kg"]["sized"]]
    for masses, moves in ((sized, False), (["0 kg", "0 kg"], True)):
        words = {f"mass{i}": text for i, text in enumerate(masses)}
        places = [view.pose({"at0": f"{angle} deg", **words})["centre_m"] for angle in (60, 90, 150)]
        assert (np.ptp(places, axis=0).max() > 1e-9) == moves


HANDLE = """one => {
  const [a, b] = one.points || [], [x, y, r] = a ? [] : [one.cx, one.cy, one.r].map((length) => length.baseVal.value);
  const place = a ? new DOMPoint((a.x + b.x) / 2, (a.y + b.y) / 2) : new DOMPoint(x, y + 0.9 * r);
  const on = place.matrixTransform(one.ownerSVGElement.getScreenCTM());
  return [on.x, on.y];
}"""
"""Of a link's first edge, or within the rim of a disc, on the screen."""


HOLD = """() => {
  window.held = [];
  window.real = window.fetch;
  window.fetch = async (...words) => {
    const answer = await real(...words);
    return new Promise((go) => held.push(() => go(answer)));
  };
}"""
"""Answers wait until they are let go."""


def gripped(found, share):
    """A place along the last link of a pose: how it is named, and where it is, right and up [m]."""
    moving = found["moving"]
    first, second = [one for one in moving["panels"][0]["shapes"] if one["kind"] == "link"][-1]["points"][:2]
    a, b = pictures(moving["panels"][0])[0][[first, second]]
    metre = moving["scale_bar_m"] / moving["scale_bar"]
    words = {"grip0": str(first), "grip1": str(second), "share": str(share)}
    return words, ((1.0 - share) * a + share * b) * [metre, -metre], 0.1 * metre


@pytest.mark.parametrize(
    ("name", "right", "up"), [("five-bar", 0.02, -0.01), ("delta", 0.03, 0.02), ("four-bar", 0.0, 0.3)]
)
def test_dragged_the_mechanism_comes_as_near_as_it_can(name, right, up):
    """With two freedoms or more to the place itself; with one to where no angle nearby brings it nearer."""
    view = MechanismView(load_mechanism(name))
    here = view.pose({})
    words, start, unit = gripped(here, 0.3)
    found = view.pose({**words, "right": f"{right} m", "up": f"{up} m"})
    wanted = start + [right, up]
    assert view.pose({f"at{i}": f"{x!r} {u}" for i, (x, u) in enumerate(zip(found["at"], view.units, strict=True))})[
        "centre_m"
    ] == pytest.approx(found["centre_m"])
    missed = np.linalg.norm(gripped(found, 0.3)[1] - wanted)
    if len(view.joints) > 1:
        assert missed < 2.0 * unit  # drawn to a tenth of a unit
    else:
        near = [view.pose({"at0": f"{found['at'][0] + off} rad"}) for off in (-0.1, -0.02, 0.02, 0.1)]
        assert missed < min(np.linalg.norm(gripped(one, 0.3)[1] - wanted) for one in near)
        assert abs(found["at"][0] - here["at"][0]) > 0.1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"mass0": "3"}, "has no unit"), ({"mass0": "-1 kg"}, "zero or a positive mass"), ({"mass0": "1 m"}, "mass"),
        ({"motion": "1", "stroke": "1 mm"}, "angle"), ({"motion": "1", "stroke": "0 deg"}, "other than zero"),
        ({"motion": "1", "stroke": "9 rad", "peak": "0.01 rad/s2"}, "at most 10 s"),
    ],
)  # fmt: skip
def test_what_is_no_quantity_is_refused(view, words, message):
    """Masses, strokes and accelerations, by what is wrong with them."""
    with pytest.raises(CounterpoiseError, match=message):
        view.response(words)


def test_without_a_motion_a_joint_moves_as_far_as_it_can():
    """A mechanism with little room is viewed all the same, and one without sites says why nothing is mounted."""
    view = MechanismView(load_mechanism("4-rrr"))
    assert view.stroke < 0.0
    assert len(view.response({})["responses"]) > 0
    found = MechanismView(load_mechanism("two-joint-arm-c1"))
    assert (found.sites == []) == bool(found.unmounted)


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A spatial loop with hostile names of bodies, joints and sites, as a file of one's own, at work."""
    text = (datasets.ROOT / "mechanisms" / "bennett.xml").read_text("utf-8")
    for kind in ("body", "joint", "site"):
        for name in dict.fromkeys(re.findall(rf'<{kind} name="([^"]+)"', text)):
            text = text.replace(f'"{name}"', f'"{name}{ESCAPED}"')
    path = tmp_path_factory.mktemp("view") / "own.xml"
    path.write_text(text, "utf-8")
    server = MechanismView(load_mechanism(path)).server()
    Thread(target=server.serve, daemon=True).start()
    yield server, path
    server.asked = float("-inf")


def test_in_a_browser(browser, serious, served):
    """Mounts, moves by hand and in a motion, turns; numbers are those of simulate; names are text; nobody is asked."""
    server, path = served
    page = browser.new_page()
    odd, asked = [], []
    page.on("console", lambda message: odd.append(message.text))
    page.on("pageerror", lambda error: odd.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(server.url)
    page.wait_for_function("() => document.querySelectorAll('#series-plots canvas').length")
    links = "all => all.map(one => one.getAttribute('points')).join()"
    for act, where in (
        (lambda: page.fill("#motion-time", "40"), "#motion-panels .link"),
        (lambda: page.locator("#motion-panels").press("ArrowRight"), "#motion-panels .link"),
        (lambda: page.fill("#view-coordinates input >> nth=1", "20 deg"), "#hand-panels .link"),
    ):
        before = page.eval_on_selector_all(where, links)
        act()
        page.keyboard.press("Enter")
        page.wait_for_function(
            f"([where, old]) => ({links})([...document.querySelectorAll(where)]) != old",
            arg=[where, before],
        )
    said = page.inner_text("#verdict")
    page.fill("#view-masses input >> nth=1", "1500 g")
    page.keyboard.press("Enter")
    page.wait_for_function("old => document.getElementById('verdict').textContent != old", arg=said)
    assert "1.5 kg" in page.input_value("#view-masses input >> nth=1")
    site = load_mechanism(path).counter_sites[0]
    assert page.inner_text("#view-masses bdi >> nth=0") == site.replace("\u202e", "\\x202e")
    values = page.eval_on_selector_all(
        "#view-rows tr", "all => all.map(row => [...row.querySelectorAll('data')].map(one => Number(one.value)))"
    )
    words = {
        f"mass{i}": page.input_value(f"#view-masses input >> nth={2 * i + 1}")
        for i in range(len(load_mechanism(path).counter_sites))
    }
    expected = server.answers["GET"]["response"](words)["responses"]
    assert values == [[*row["rms"], *row["peak"]] for row in expected]
    for part, value in (("#hand-panels .link >> nth=1", "#view-coordinates input >> nth=1"),
                        ("#hand-panels .counter >> nth=0", "#view-masses input >> nth=1")):  # fmt: skip
        page.eval_on_selector(part, "one => one.scrollIntoView({block: 'center'})")  # at once: it is drawn anew
        x, y = page.eval_on_selector(part, HANDLE)
        page.mouse.move(x, y)
        page.mouse.down()
        before = page.input_value(value)
        page.mouse.move(x + 30, y - 20, steps=3)
        page.wait_for_function(
            "([where, old]) => document.querySelectorAll(where)[1].value != old",
            arg=[value.partition(" >>")[0], before],
        )
        page.mouse.up()
    page.wait_for_function("() => document.getElementById('hand-now').textContent.includes('Held by')")
    page.evaluate(HOLD)
    for text in ("1 kg", "2 kg"):  # the second is typed before the answer to the first
        page.fill("#view-masses input >> nth=1", text)
        page.keyboard.press("Enter")
        page.wait_for_function("() => held.length == 2")
    page.evaluate("() => held.splice(0).forEach((go) => go())")
    page.wait_for_function("() => held.length == 2")
    page.evaluate("() => { window.fetch = real; held.splice(0).forEach((go) => go()); }")
    page.wait_for_load_state("networkidle")
    assert page.input_value("#view-masses input >> nth=1") == "2 kg"
    page.fill("#view-masses input >> nth=1", "much")
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.getElementById('view-error').textContent.includes('expected a number')")
    page.click("#motion-play")
    assert serious(page) == []
    assert page.title() == "View of own"
    assert [text for text in odd if "422" not in text] == []
    assert all(url.startswith(server.url) for url in asked)
    page.close()


def test_the_secret_is_in_no_argument(monkeypatch):
    """The browser is given a page that only this user can read, which leads on, and which goes with the command."""
    given = []

    def opened(address):
        page = Path(unquote(urlparse(address).path))
        given.append(
            (address, page, page.read_text("utf-8"), page.stat().st_mode & 0o777, page.parent.stat().st_mode & 0o777)
        )

    monkeypatch.setattr(webbrowser, "open", opened)
    done = call(main, "balance", "view", "four-bar", "--motion", "four-bar", "--idle", "0")
    url = re.search(r"http://\S+", done.out)[0]
    (address, page, text, mode, folder) = given[0]
    assert address.startswith("file://")
    assert url.split("/")[3] not in address
    assert url in text
    assert (mode, folder) == (0o600, 0o700)
    assert not page.parent.exists()
    assert done.code == 0
