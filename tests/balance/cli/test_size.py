"""``balance size`` and ``balance tradeoff``."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from balance import datasets, follow, load, simulate, size
from balance.balancing import sizing_study
from balance.errors import SizingError

KEYS = {
    "counter_masses", "residual_first_moment_kgm", "residual_percent", "balanced_payload_kg", "added_mass_kg",
    "added_inertia_kgm2",
}  # fmt: skip
COUNTER_KEYS = {"site", "mass_kg", "position_m", "first_moment_kgm", "plates"}


def test_json_has_the_keys_that_are_promised(balance):
    """Counter-masses with site, mass, place, first moment and plates; what is left, added, and balanced."""
    code, out, err = balance("size", "parallelogram-6bar", "--payload", "platform=5kg", "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert document.keys() >= KEYS
    assert [c.keys() >= COUNTER_KEYS for c in document["counter_masses"]] == [True, True]
    assert [c["mass_kg"] for c in document["counter_masses"]] == pytest.approx([24.276118] * 2, abs=1e-6)
    assert document["counter_masses"][0]["position_m"] == [-0.03755, 0.0, 0.0]
    assert document["balanced_payload_kg"] == pytest.approx({"platform": 5.0})
    assert document["added_mass_kg"] == pytest.approx(48.552236, abs=1e-6)
    assert document["residual_first_moment_kgm"] < 1e-12


def test_stock(balance):
    """The best set for 3.4116 kg: M1 + M2 + M4, leaving 0.02581 kg m."""
    arguments = ("size", "parallelogram-6bar", "-p", "platform=3.4116kg", "--stock", "kiper2019")
    document = json.loads(balance(*arguments, "--json").out)
    assert [c["plates"] for c in document["counter_masses"]] == [["M1", "M2", "M4"]] * 2
    assert document["residual_first_moment_kgm"] == pytest.approx(0.02581, abs=5e-6)
    out = balance(*arguments).out
    assert "M1 + M2 + M4" in out
    assert "17.2437" in out


FOUR_BAR = ("four-bar", "--motion", "four-bar")
LIMITS = ("--limit", "counter_A0A=0.6kg", "--limit", "counter_B0B=0.6kg")
EQUAL = ("--equal", "counter_A0A,counter_B0B")
OF_PLATFORM = ("parallelogram-6bar", "-p", "platform=1.451kg")


@pytest.mark.parametrize(
    ("given", "plate", "wanting", "said"),
    [
        (("parallelogram-6bar", "-p", "platform=3.4116kg"), "", {"M2"}, "with one more of a plate: M2 "),
        ((*FOUR_BAR,), "A,1.2,2", set(), "All plates of the stock are used."),
        ((*FOUR_BAR,), "A,1.2,9", set(), ""),
        ((*FOUR_BAR, *LIMITS), "A,0.5,2", set(), "All plates of the stock are used."),
        ((*FOUR_BAR,), "A,0.5,2", {"A"}, "one more of a plate: A "),
        ((*FOUR_BAR, "--added", "1kg"), "A,0.5,2", set(), "All plates of the stock are used."),
        ((*FOUR_BAR, "--added", "1.4kg"), "A,0.5,2", set(), "All plates of the stock are used."),
        ((*FOUR_BAR, "--added", "1.5kg"), "A,0.5,2", {"A"}, "one more of a plate: A "),
        ((*FOUR_BAR, *EQUAL), "A,0.3,3", {"A"}, "2 more of a plate: A "),
        ((*FOUR_BAR, *EQUAL), "A,0.3,9", set(), ""),
        ((*FOUR_BAR,), "A,998,2", set(), "A of 998.0000 kg, is heavier than the mass needed at every"),
        ((*FOUR_BAR,), "A,998,0", set(), "All plates of the stock are used."),
        (OF_PLATFORM, "", set(), ""),
        ((*OF_PLATFORM, "-p", "platform=15kg"), "", {"M1", "M2", "M3", "M4"}, "one more of a plate: M4 "),
        ((*OF_PLATFORM, "-p", "platform=2kg"), "A,1,500", set(), ""),
    ],
)  # fmt: skip
def test_plates_of_which_more_would_leave_less_are_named(balance, tmp_path, given, plate, wanting, said):
    """Those alone, too few for a group of equal sites included; else whether all are used, too heavy, or nothing."""
    (tmp_path / "stock.csv").write_text(f"name,mass_kg,quantity\n{plate}\n", encoding="utf-8")
    stock = ("--stock", str(tmp_path / "stock.csv") if plate else "kiper2019")
    document = json.loads(balance("size", *given, *stock, "--json").out)
    out = balance("size", *given, *stock).out
    assert {one["plate"] for one in document["with_more_plates"]} == wanting
    assert all(one["proven"] for one in document["with_more_plates"])
    assert document["all_plates_used"] or not said.startswith("All")
    assert said in out
    assert bool(said) == any(words in out for words in ("Less would remain", "All plates", "The lightest plate"))


def test_a_motion_compares_before_and_after(balance):
    """Force vanishes, moment and torque rise: rms and peak, before and after, in JSON and in the table."""
    arguments = ("size", "parallelogram-6bar", "-p", "platform=5kg", "--motion", "x")
    document = json.loads(balance(*arguments, "--json").out)
    before, after = document["before"], document["after"]
    assert before["peak"]["Fx_N"] == pytest.approx(3 * 59.617, rel=1e-3)
    assert after["peak"]["Fx_N"] < 1e-9
    assert after["rms"]["torque_Nm"]["A0"] > before["rms"]["torque_Nm"]["A0"]
    assert set(before) == set(after) == {"rms", "peak"}
    assert "RMS after" in balance(*arguments).out


def test_a_limit_and_a_site(balance):
    """A limit holds; a site of one's own choice is used."""
    code, out, _ = balance("size", "parallelogram-6bar", "--limit", "counter_A0A=5kg", "--json")
    assert code == 3
    assert json.loads(out)["counter_masses"][0]["mass_kg"] == pytest.approx(5.0)
    out = balance("size", "serial-1r", "--site", "counter_link_1", "--json").out
    assert json.loads(out)["counter_masses"][0]["mass_kg"] == pytest.approx(1.68)


@pytest.mark.parametrize("stock", [(), ("--stock", "stock.csv")])
def test_a_total_holds_and_its_price_is_said(balance, tmp_path, monkeypatch, stock):
    """The least force with 1.2 kg in all is that of `balance tradeoff`; of plates of 0.1 kg, of no others there are."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stock.csv").write_text("name,mass_g,quantity\nA,100,40\n", encoding="utf-8")
    given = ("size", *FOUR_BAR, "--added", "1.2kg", *stock)
    code, text, _ = balance(*given)
    document = json.loads(balance(*given, "--json").out)
    first = json.loads(balance("tradeoff", *FOUR_BAR, "--added", "1.2kg", "--points", "4", "--json").out)["points"][0]
    least = document["rms_N"]
    if stock:
        mechanism, masses = load("four-bar"), [{}, {"counter_A0A": 0.1}, {"counter_B0B": 0.1}]
        force, first_site, second_site = (simulate(mechanism.with_counter_mass(m), "four-bar").force for m in masses)
        a, b = first_site - force, second_site - force  # of a plate at either site: the force is linear in masses
        made = [force + i * a + k * b for i in range(13) for k in range(13 - i)]
        assert least == pytest.approx(min(np.sum(one**2, axis=1).mean() ** 0.5 for one in made), rel=1e-9)
        assert first["rms_force_N"] < least
        assert "No other choice of these plates within 1.2 kg in all leaves less." in text
    else:
        assert least == pytest.approx(first["rms_force_N"], rel=1e-9)
        assert "No other masses at these sites within 1.2 kg in all leave less." in text
    assert (code, document["added_limit_kg"], document["sites_needed"]) == (3, 1.2, [])
    assert document["added_mass_kg"] <= 1.2 + 1e-12
    assert document["without_limits"]["added_mass_kg"] == pytest.approx(2.444, abs=1e-3)
    assert "Without the limit of 1.2 kg in all, masses of any size at these sites would balance it completely" in text


def with_sites(text, more):
    """An MJCF text with more sites: name, body and place [m] of each."""
    for name, body, place in more:
        start = text.index(">", text.index(f'<body name="{body}"')) + 1
        text = f'{text[:start]}<site name="{name}" pos="{" ".join(map(repr, place))}"/>{text[start:]}'
    return text


def four_bar_force(centres, extra=(), samples=400):
    """Force of masses on the shipped four-bar in its motion, as complex numbers, by circles that meet and differences.

    ``centres``: body, place [m] and mass [kg], as are ``extra`` ones.
    """
    moved = follow(load("four-bar"), "four-bar")
    step = len(moved.time) // samples
    q, v, a = (values[::step, 0] for values in (moved.q, moved.v, moved.a))

    def moment(angle):
        pin = 0.1 * np.exp(1j * angle)
        apart = 0.25 - pin
        along = (abs(apart) ** 2 + 0.26**2 - 0.2**2) / (2.0 * abs(apart))
        joint = pin + apart / abs(apart) * (along + 1j * np.sqrt(0.26**2 - along**2))
        frames = {
            "A0A": (0.0, np.exp(1j * angle)), "AB": (pin, (joint - pin) / 0.26), "B0B": (0.25, (joint - 0.25) / 0.2)
        }  # fmt: skip
        return sum(mass * (frames[body][0] + frames[body][1] * place) for body, place, mass in [*centres, *extra])

    h = 2e-3
    back2, back, here, on, on2 = (moment(q + k * h) for k in (-2, -1, 0, 1, 2))
    first = (back2 - 8.0 * back + 8.0 * on - on2) / (12.0 * h)
    return (-back2 + 16.0 * back - 30.0 * here + 16.0 * on - on2) / (12.0 * h**2) * v**2 + first * a


SKEW = (0.01 / 3.0, 0.12 + 0.03j, 0.09 - 0.04j)
"""Of a four-bar with one site: its y, and the centres of coupler and rocker, which one mass on the coupler balances."""


@pytest.mark.parametrize(
    ("across", "coupler", "rocker", "limit", "helpful"),
    [(0.0, 0.12, 0.09, None, {"AB", "B0B"}), (*SKEW, None, {"AB"}), (*SKEW, 0.5, {"B0B"}), (*SKEW, 9.0, {"AB"})],
)
def test_a_further_site_leaves_what_is_stated(balance, tmp_path, across, coupler, rocker, limit, helpful):
    """By own formulae the masses at the places leave that, and no place on a grid less; sized again, they are found."""
    text = (datasets.ROOT / "mechanisms/four-bar.xml").read_text()
    for was, now in (("-0.05 0 0", -0.05 + 1j * across), ("0.12 0 0", coupler), ("0.09 0 0", rocker)):
        text = text.replace(f'pos="{was}"', f'pos="{now.real} {now.imag} 0"')
    (tmp_path / "m.xml").write_text(text)
    given = ["--motion", "four-bar", "--site", "counter_A0A", "--json"]
    given += ["--limit", f"counter_A0A={limit}kg"] if limit else []
    found = json.loads(balance("size", tmp_path / "m.xml", *given).out)["sites_needed"]
    first = [one for one in found if len(one["new_sites"]) == 1]
    assert {one["new_sites"][0]["body"] for one in first} == helpful
    centres = [("A0A", 0.04, 0.4), ("AB", coupler, 0.7), ("B0B", rocker, 0.5)]
    crank, whole, scale = -0.05 + 1j * across, four_bar_force(centres), 1e-2 * np.linalg.norm(four_bar_force(centres))
    for one in found:
        extra = [("A0A", crank, one["counter_masses_kg"]["counter_A0A"])]
        extra += [(new["body"], complex(*new["position_m"][:2]), new["mass_kg"]) for new in one["new_sites"]]
        left = np.linalg.norm(four_bar_force(centres, extra)) / scale
        assert one["remaining_percent"] == pytest.approx(left, rel=2e-3, abs=1e-4)
        more = [(f"more_{k}", new["body"], new["position_m"]) for k, new in enumerate(one["new_sites"])]
        (tmp_path / "more.xml").write_text(with_sites(text, more))
        sites = [word for name, *_ in more for word in ("--site", name)]
        again = json.loads(balance("size", tmp_path / "more.xml", *given, *sites).out)
        assert again["remaining_percent"] == pytest.approx(one["remaining_percent"], rel=1e-6, abs=1e-4)
        assert again["added_mass_kg"] == pytest.approx(one["added_mass_kg"], rel=1e-6)
    if across and limit != 0.5:  # the one mounting that balances, from the vectors of the links
        mass = 10.0 * (0.05 * 3.0 - 0.016 - 0.5 * 0.045) - 0.7
        place = (-1.3 * 0.5 * rocker - 0.7 * coupler) / mass
        assert first[0]["new_sites"][0]["mass_kg"] == pytest.approx(mass, rel=1e-5)
        assert complex(*first[0]["new_sites"][0]["position_m"][:2]) == pytest.approx(place, rel=1e-5)
    beside, turns = four_bar_force([("A0A", crank, 1.0)]), np.exp(1j * np.linspace(0.1, 6.2, 24))
    for times, part in ((1.0, 1.0 - 2e-3), (4.0, 0.9)):
        for body, far in (("A0A", 0.1), ("AB", 0.26), ("B0B", 0.2)):
            here, there = (four_bar_force([(body, place, 1.0)]) for place in (0.0, 1.0))
            for place in (times * far * np.linspace(0.1, 1.0, 6)[:, None] * turns).ravel():
                columns = np.stack([beside, here + place * (there - here)])
                gram, pull = (columns @ columns.conj().T).real, -(columns @ whole.conj()).real
                one = np.linalg.solve(gram, pull)
                if not ((one >= 0.0) & (one <= [limit or np.inf, np.inf])).all():
                    ends = (
                        [np.clip(pull[0] / gram[0, 0], 0.0, limit), 0.0],
                        *([x, max(pull[1] - gram[0, 1] * x, 0.0) / gram[1, 1]] for x in (0.0, limit or 0.0)),
                    )
                    one = min(ends, key=lambda m: np.linalg.norm(whole + np.array(m) @ columns))
                assert first[0]["remaining_percent"] * part <= np.linalg.norm(whole + one @ columns) / scale


def test_further_sites_heed_equal_masses(balance):
    """Links 1 and 3 of the chain take 0.54 kg each; without that link 1 takes far more, and fewer sites do."""
    sites = ("counter_link_1", "counter_link_3")
    given = ("size", "serial-3r", "--site", sites[0], "--site", sites[1], "--json")
    free, equal = (
        json.loads(balance(*given, *more).out)["sites_needed"][-1] for more in ((), ("--equal", ",".join(sites)))
    )
    first, third = (equal["counter_masses_kg"][site] for site in sites)
    assert first == pytest.approx(third)
    assert free["counter_masses_kg"][sites[0]] > 2.0 * first
    assert max(free["remaining_percent"], equal["remaining_percent"]) < 1e-4


def test_advice_on_further_sites_is_found_with_a_total_or_left_out(balance, monkeypatch):
    """A limit that holds nothing leaves the advice as it is; trials that do not converge leave it out alone."""
    given = ("size", "forbal-2", "--json")
    free, within = (json.loads(balance(*given, *more).out) for more in ((), ("--added", "0.1kg")))
    assert [one["remaining_percent"] for one in within["sites_needed"]] == pytest.approx(
        [one["remaining_percent"] for one in free["sites_needed"]], abs=1e-3
    )
    assert {one["new_sites"][-1]["body"] for one in within["sites_needed"]} == {"link11", "link12", "link21", "link22"}
    monkeypatch.setattr(sizing_study, "_with_sites_on", refuse)
    without = json.loads(balance(*given).out)
    unknown = dict.fromkeys(("link11", "link12", "link21", "link22"), "counter-masses did not converge")
    assert without == free | {"sites_needed": [], "sites_unknown": unknown}


def refuse(*_):
    """A trial that does not converge."""
    raise SizingError("counter-masses did not converge")


def test_the_verdict_comes_first_and_names_the_body_that_lacks_a_site(balance):
    """One site of two, on its motion: exit 3; what remains by direction, and the body that would remove it."""
    arguments = ("size", "four-bar", "--motion", "four-bar", "--site", "counter_A0A")
    code, out, _ = balance(*arguments)
    assert code == 3
    first = "Not balanced completely: 52.8 % of the RMS shaking force remains in motion four-bar (6.383 N of 12.09 N)"
    assert out.startswith(first)
    assert "With a further site, on AB or B0B: nothing would remain." in out
    assert re.search(r"\nAB +0.5481  x -260 +3.2662  nothing\nB0B +0.5481  x -200 +1.0738  nothing\n", out)
    assert "First-moment residual" not in out  # a number without meaning where masses here cannot meet the conditions
    document = json.loads(balance(*arguments, "--json").out)
    assert document["balanced"] is False
    assert document["rms_N"] == pytest.approx(document["rms_bound_N"], rel=1e-9)
    assert [one["new_sites"][0]["body"] for one in document["sites_needed"]] == ["AB", "B0B"]
    given = {one["body"]: one["given_kgm"][0] for one in document["first_moments"]}
    assert given == {"A0A": document["counter_masses"][0]["first_moment_kgm"][0], "AB": 0.0, "B0B": 0.0}
    assert "body  sites give [kg m]  missing [kg m]" in out
    squares = sum(one["rms_N"] ** 2 for one in document["remaining_directions"])
    assert squares == pytest.approx(document["rms_N"] ** 2, rel=1e-9)
    several = balance("size", "serial-2r", "--site", "tip").out  # no alternatives: each beside the ones before it
    assert "With a further site, on link_1: 59.1 % would remain.\n" in several
    assert "With further sites, on link_1 and link_2: nothing would remain.\n" in several


def test_limits_hold_for_plates_too_and_the_best_few_are_listed(balance, tmp_path):
    """Plates of 0.25 kg, a limit of 1.3 kg: 1.25 kg is best, then 1 and 0.75 kg."""
    stock = tmp_path / "q.csv"
    stock.write_text("name,mass_kg,quantity\nQ,0.25,20\n", encoding="utf-8")
    arguments = ("size", "four-bar", "--site", "counter_A0A", "--stock", stock, "--limit", "counter_A0A=1300g")
    code, out, _ = balance(*arguments, "--motion", "four-bar", "--best", "3", "--json")
    assert code == 3
    masses = [one["counter_masses"][0]["mass_kg"] for one in json.loads(out)["sets"]]
    assert masses == [1.25, 1.0, 0.75]
    out = balance(*arguments, "--motion", "four-bar", "--best", "9").out
    limited = balance("size", "four-bar", "--site", "counter_A0A", *arguments[-2:], "--motion", "four-bar", "--json")
    least = json.loads(limited.out)["remaining_percent"]
    assert f"Masses of other sizes at these sites would leave {least:.3g} % within their limits." in out
    assert "6 of 9 sets: there are no others" in out


def test_equal_masses_forbidden_sites_and_other_objectives(balance):
    """Equal masses are equal, a forbidden site has none, drive torque asks for less mass than force."""
    motion = ("size", "parallelogram-6bar", "--motion", "x", "--json")
    limited = (*motion, "--limit", "counter_A0A=5kg", "--equal", "counter_A0A,counter_B0B")
    assert [c["mass_kg"] for c in json.loads(balance(*limited).out)["counter_masses"]] == [5.0, 5.0]
    document = json.loads(balance(*motion, "--without", "counter_A0A").out)
    assert [c["site"] for c in document["counter_masses"]] == ["counter_B0B"]
    document = json.loads(balance(*motion, "--objective", "force", "--objective", "torque=5").out)
    assert document["added_mass_kg"] < json.loads(balance(*motion).out)["added_mass_kg"]
    assert document["objective"]["weights"] == {"force": 1.0, "torque": 5.0}
    assert document["sites_needed"] == []  # of a mass at any place the torque is open: no body is promised to help


def test_a_figure_is_drawn(balance, tmp_path):
    """The drawing of the mechanism with its counter-masses, in the format of its ending; others are refused."""
    assert balance("size", "four-bar", "--figure", tmp_path / "four-bar.svg").code == 0
    assert "<svg" in (tmp_path / "four-bar.svg").read_text(encoding="utf-8")
    refused = balance("size", "four-bar", "--figure", tmp_path / "four-bar.doc")
    assert refused.code == 1
    assert "expected one of" in refused.err
    assert not (tmp_path / "four-bar.doc").exists()


def test_closed_form_works_without_pinocchio():
    """Pinocchio hidden: the printed formula sizes the manipulator, and says that no model was evaluated."""
    code = (
        "import sys; sys.modules['pinocchio'] = None\nfrom balance.cli import main\n"
        "sys.argv = ['balance', 'size', 'parallelogram-6bar', '--payload', 'platform=5kg', '--closed-form']\n"
        "try: main()\nexcept SystemExit as end: assert not end.code\n"
        "print('afterwards', file=sys.stderr); sys.argv.pop(); main()"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "24.2761 kg" in shown.stdout
    assert "no model was evaluated" in shown.stdout
    assert (shown.returncode, shown.stderr.splitlines()[0]) == (1, "afterwards")
    assert "conda-forge" in shown.stderr


def test_closed_form_in_json(balance):
    """The same keys, null where only a model could tell."""
    code, out, _ = balance("size", "parallelogram-6bar", "--payload", "platform=5kg", "--closed-form", "--json")
    document = json.loads(out)
    assert code == 0
    assert document.keys() >= KEYS
    assert document["counter_masses"][1].keys() >= COUNTER_KEYS
    assert document["counter_masses"][0]["first_moment_kgm"][0] == pytest.approx(-0.9116, abs=5e-5)
    assert document["residual_first_moment_kgm"] is None


PAYLOADS = ("-p", "platform=5kg", "-p", "platform=1.451kg", "-p", "platform=3.4116kg")


def test_sets_that_grow_with_the_payload(balance):
    """Rising payloads, each set holding the one before; the sets that were built are added, not substituted."""
    document = json.loads(balance("size", "parallelogram-6bar", *PAYLOADS, "--stock", "kiper2019", "--json").out)
    assert [s["payload_kg"]["platform"] for s in document["sets"]] == [1.451, 3.4116, 5.0]
    assert all(s.keys() >= KEYS for s in document["sets"])
    assert [s["counter_masses"][1]["plates"][-1] for s in document["sets"]] == ["M2", "M4", "M4"]
    assert [s["increments_kg"]["counter_A0A"] for s in document["sets"]] == pytest.approx([10.09167, 7.15208, 7.01882])
    published = document["published"]
    assert [s["plates"] for s in published["sets"]] == [["M1", "M2", "M3", "M4"][:n] for n in (2, 3, 4)]
    assert published["sets"][1]["residual_first_moment_kgm"] == pytest.approx(0.03081, abs=5e-6)
    assert published["increments_kg"] == [7.00735, 7.16965]
    out = balance("size", "parallelogram-6bar", *PAYLOADS, "--stock", "kiper2019").out
    assert "7.00735 and 7.16965 kg" in out
    assert "proven" in out


def test_exact_sets_that_grow(balance):
    """Without stock: each payload exactly, and what is added; nothing published is added."""
    document = json.loads(balance("size", "parallelogram-6bar", *PAYLOADS, "--json").out)
    assert [s["increments_kg"]["counter_B0B"] for s in document["sets"]] == pytest.approx(
        [10.099021, 7.831957, 6.34514], abs=1e-6
    )
    assert "published" not in document
    assert "First-moment residual at platform = 5.0000 kg" in balance("size", "parallelogram-6bar", *PAYLOADS).out


def test_one_set_for_all_payloads_within_a_limit(balance):
    """The same masses in each row, none beyond its limit; what remains with each payload is said first."""
    arguments = ("size", "parallelogram-6bar", *PAYLOADS, "--fixed", "--limit", "counter_A0A=15kg")
    code, out, _ = balance(*arguments)
    assert code == 3
    assert out.startswith("Not balanced completely: ")
    assert "one set for all payloads" in out
    sets = json.loads(balance(*arguments, "--json").out)["sets"]
    masses = [[one["mass_kg"] for one in each["counter_masses"]] for each in sets]
    assert masses[0] == masses[1] == masses[2]
    assert max(row[0] for row in masses) <= 15.0


@pytest.mark.parametrize(
    "arguments",
    [
        ("parallelogram-6bar", "--closed-form"),
        ("four-bar", "--payload", "AB=1kg", "--closed-form"),
        ("parallelogram-6bar", "-p", "platform=5kg", "--closed-form", "--stock", "kiper2019"),
        ("parallelogram-6bar", "-p", "platform=5kg", "--closed-form", "--motion", "x"),
        ("parallelogram-6bar", "--best", "3"),
        ("parallelogram-6bar", "--objective", "torque"),
        ("parallelogram-6bar", "--motion", "x", "--objective", "noise"),
        ("parallelogram-6bar", "--without", "C_AC"),
        ("parallelogram-6bar", "--without", "counter_A0A", "--without", "counter_B0B"),
        ("parallelogram-6bar", *PAYLOADS, "--best", "2", "--stock", "kiper2019"),
        ("parallelogram-6bar", "-p", "platform=5kg", "--fixed"),
        ("parallelogram-6bar", *PAYLOADS, "-p", "AC=1kg", "-p", "AC=2kg"),
        ("parallelogram-6bar", *PAYLOADS, "-p", "platform=5kg"),
    ],
)
def test_options_that_do_not_go_together(balance, arguments):
    """A message, exit 2; nothing is ignored in silence."""
    code, out, err = balance("size", *arguments)
    assert (code, out) == (2, "")
    assert "--" in err.splitlines()[-1]


def test_the_front_of_force_moment_torque_and_mass(balance, tmp_path):
    """A verdict line and a table; JSON with all points; a figure."""
    arguments = ("tradeoff", "four-bar", "--motion", "four-bar", "--points", "12", "--figure", tmp_path / "front.svg")
    code, out, err = balance(*arguments)
    assert (code, err) == (0, "")
    assert "points of the front" in out.splitlines()[0]
    assert "<svg" in (tmp_path / "front.svg").read_text(encoding="utf-8")
    document = json.loads(balance(*arguments[:-2], "--json").out)
    assert document["points"][0].keys() == {
        "rms_force_N", "rms_moment_Nm", "rms_torque_Nm", "added_mass_kg", "counter_masses_kg",
        "least_force_for_mass",
    }  # fmt: skip
    marked = sum(point["least_force_for_mass"] for point in document["points"])
    assert f"\n{marked} points of the least force for their mass; --all and --json have all 12" in out


def test_a_front_whose_least_force_is_without_masses(balance):
    """It says what the points differ in; one point is one point."""
    out = balance("tradeoff", "whitworth", "--motion", "whitworth", "--points", "12", "--added", "1kg").out
    assert out.startswith("The least force, 25.04 N, is with 0 kg; more mass lessens the moment from 0.8013 to 0.7915")
    assert "\n1 point of the least force for its mass; --all and --json have all 10." in out


def test_least_vibration_of_a_base(balance, tmp_path):
    """The verdict first, in m/s2; it states that no bound is known, and what of the rig it leaves out."""
    (tmp_path / "m.toml").write_text(
        'driven = "joints"\njoints = ["A0"]\nstart = ["1 rad"]\npeak_acceleration = "50 rad/s^2"\n'
        'moves = [ { joint = "A0", to = ["1.5 rad"] } ]\n',
        encoding="utf-8",
    )
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text(encoding="utf-8")
    text = text.replace('mechanism = "parallelogram-6bar"', 'mechanism = "four-bar.xml"')
    (tmp_path / "r0.toml").write_text(text, encoding="utf-8")
    (tmp_path / "r.toml").write_text(text.replace("[bench]", "[bench]\nweight = true"), encoding="utf-8")
    given = ("size", "four-bar", "--motion", str(tmp_path / "m.toml"), "--objective", "vibration")
    code, _, err = balance(*given, "--rig", "parallelogram-6bar")
    assert (code, "is of mechanism 'parallelogram-6bar', not 'four-bar'" in err) == (1, True)
    code, out, _ = balance(*given, "--rig", str(tmp_path / "r0.toml"))
    assert (code, "Balanced payload" in out) == (3, False)
    assert re.match(
        r"Not balanced completely: [\d.]+ % of the RMS acceleration remains .* m/s2 of .* m/s2\), .*\nNo", out
    )
    assert "a bound is not known" in out
    document = json.loads(balance(*given, "--rig", str(tmp_path / "r.toml"), "--json").out)
    assert document["rms_m_per_s2"] < 0.5 * document["rms_before_m_per_s2"]
    assert (document["rms_bound_m_per_s2"], document["left_out"]) == (None, ["bench.weight"])
    at_the_prompt = size("four-bar", str(tmp_path / "m.toml"), objective={"vibration": 1.0}, rig=tmp_path / "r.toml")
    assert at_the_prompt.verdict.after == document["rms_m_per_s2"]
    weighed = json.loads(balance(*given, "--objective", "force=2", "--rig", str(tmp_path / "r0.toml"), "--json").out)
    assert weighed["objective"]["weights"] == {"vibration": 1.0, "force": 2.0}
    assert weighed["rms"] < weighed["rms_before"] == pytest.approx(3.0**0.5)
    for wrong in (given, (*given[:-2], "--rig", "r")):
        code, _, err = balance(*wrong)
        assert (code, "--objective vibration and --rig RIG go together" in err) == (2, True)
