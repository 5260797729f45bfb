"""The page of a design: numbers of `--json`, which are those of `balance size`; nothing measured is claimed."""

import json
import re
from hashlib import sha256

import numpy as np
import pytest

import balance
from balance import datasets
from balance.cli import main
from balance.report.page import Page

from ...commands import call


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The page of a four-bar, and the document of its command."""
    path = tmp_path_factory.mktemp("page") / "four-bar.html"
    done = call(main, "balance", "report", "four-bar", "--motion", "four-bar", "-o", path, "--json")
    assert done.code == 0, done.err
    return path.read_text("utf-8"), done.json


def test_numbers_are_the_documents(made):
    """Each stands where the document has it, to the digits shown; all responses are there."""
    text, document = made
    pointers = Page(None, document)
    found = re.findall(r'<data value="([^"]*)" data-at="([^"]*)">([^<]*)</data>', text)
    for value, pointer, shown in found:
        assert json.loads(value) == pointers.at(pointer)
        assert float(shown) == pytest.approx(pointers.at(pointer), rel=0.01, abs=5e-5)
    places = {pointer for _, pointer, _ in found}
    (only,) = document["payloads"]
    for i, _ in enumerate(only["responses"]):
        assert {
            f"/payloads/0/responses/{i}/{kind}_{side}" for kind in ("rms", "peak") for side in ("before", "after")
        } <= places
    assert "SIMULATED" in text
    assert document["verdict"] in text


def test_sizing_is_that_of_size(made):
    """The same counter-masses, residual and responses as the command that sizes."""
    sized = call(main, "balance", "size", "four-bar", "--motion", "four-bar", "--json").json
    assert {name: sized[name] for name in made[1]["sizing"]} == made[1]["sizing"]
    rows = made[1]["payloads"][0]["responses"]
    assert {"F_N", "Fx_N", "Fy_N", "Mz_Nm"} <= {row["component"] for row in rows}  # forces that are gone too
    for row in rows[1:]:
        name = re.sub(r"^torque_(.*)_Nm$", r"\1", row["component"])
        for kind in ("rms", "peak"):
            for side in ("before", "after"):
                group = sized[side][kind]
                assert row[f"{kind}_{side}"] == group.get(name, group["torque_Nm"].get(name))


def test_a_motion_is_named_once_without_its_folder(tmp_path):
    """On the page of a design and on that of a mechanism moving."""
    own, path = tmp_path / "own.toml", tmp_path / "page.html"
    own.write_text(datasets.find_dataset("four-bar", "motions", ".toml").read_text("utf-8"), "utf-8")
    for command in ("report", "animate"):
        assert call(main, "balance", command, "four-bar", "--motion", own, "-o", path).code == 0
        text = path.read_text("utf-8")
        assert '<option value="0">own.toml</option>' in text
        assert str(own) not in text


PLATES = ["parallelogram-6bar", "-p", "platform=5kg", "--motion", "x", "--stock", "kiper2019"]
LIMITED = ["four-bar", "--motion", "four-bar", "--limit", "counter_A0A=1kg", "--added", "2kg", "--objective", "moment"]


@pytest.mark.parametrize(
    ("words", "code", "small", "allowed"),
    [
        (["four-bar", "--motion", "four-bar", "--site", "counter_A0A"], 3, "shaking force", "counter_A0A"),
        (["four-bar", "--motion", "four-bar", "--without", "counter_A0A"], 3, "shaking force", "counter_B0B"),
        (PLATES, 0, "shaking force", "counter_A0A; counter_B0B"),
        (LIMITED, 3, "shaking moment", "counter_A0A, at most 1 kg; counter_B0B; at most 2 kg in all"),
    ],
)
def test_what_remains_comes_first(words, code, small, allowed, tmp_path):
    """The verdict is the first line, with its number, that of size with the same options, as its exit code is."""
    done = call(main, "balance", "report", *words, "-o", tmp_path / "page.html")
    sized = call(main, "balance", "size", *words)
    assert done.code == sized.code == code
    assert done.out.splitlines()[0] == f"{words[0]}: {sized.out.splitlines()[0]}"
    assert f"of the RMS {small} remains" in done.out
    text = (tmp_path / "page.html").read_text("utf-8")
    assert f"<dt>Made small</dt><dd>{small} of the motion</dd>" in text
    assert f"<dt>Masses allowed at</dt><dd><bdi>{allowed}</bdi></dd>" in text


LOADS = ("-p", "AB=1kg", "-p", "AB=2kg")
GIVEN = {"counter_A0A": 1.5, "counter_B0B": 1.9}
MOUNTED = [word for site, mass in GIVEN.items() for word in ("-c", f"{site}={mass}kg")]


def page(path, *words) -> tuple[int, str, dict]:
    """Exit code, page and document of a report of the four-bar."""
    done = call(main, "balance", "report", "four-bar", "--motion", "four-bar", *words, "-o", path, "--json")
    assert done.code in (0, 3), done.err
    return done.code, path.read_text("utf-8"), done.json


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """For pages."""
    return tmp_path_factory.mktemp("pages")


def test_a_page_names_its_payload_and_the_files_it_is_from(tmp_path):
    """In title, provenance and document; files by name and SHA-256 of their bytes: what they include and refer to."""
    text = datasets.find_dataset("four-bar", "mechanisms", ".xml").read_text("utf-8")
    root = next(line for line in text.splitlines() if "<mujoco" in line)
    files = {
        "own.xml": f'{root}<include file="part.xml"/></mujoco>', "part.xml": text, "own.toml": "",
        "plates.csv": "name,mass_kg,quantity\r\nP,0.5,9\r\n",
    }  # fmt: skip
    files["own.toml"] = 'driven = "joints"\njoints = ["A0"]\nsamples = "own.csv"\n'
    t = np.linspace(0.0, 1.0, 501)
    files["own.csv"] = "time [s],A0 [deg]\r\n" + "".join(
        f"{x!r},{90.0 * x**3 * (10 - 15 * x + 6 * x**2)!r}\r\n" for x in t.tolist()
    )
    for name, content in files.items():
        (tmp_path / name).write_bytes(content.encode())
    words = ("--motion", tmp_path / "own.toml", "--stock", tmp_path / "plates.csv", "-o", tmp_path / "page.html")
    titles = set()
    for mass in ("0.9kg", "1.3kg"):
        done = call(main, "balance", "report", tmp_path / "own.xml", "-p", f"AB={mass}", *words, "--json")
        assert done.code in (0, 3), done.err
        shown = (tmp_path / "page.html").read_text("utf-8")
        titles.add(re.search("<h1>(.*)</h1>", shown)[1])
        assert f"<dt>Payload</dt><dd><bdi>AB {mass.removesuffix('kg')} kg</bdi></dd>" in shown
        assert done.json["payloads"][0]["payload_kg"] == done.json["sizing"]["payload_kg"] == {"AB": float(mass[:3])}
        given = {one["name"]: one["sha256"] for one in done.json["inputs"]}
        assert given == {name: sha256(content.encode()).hexdigest() for name, content in files.items()}
        assert all(digest in shown for digest in given.values())
        assert str(tmp_path) not in shown.partition("</main>")[0]
    assert titles == {"Counter-masses of own, AB 0.9 kg", "Counter-masses of own, AB 1.3 kg"}


def test_masses_that_are_given_have_a_page(folder):
    """What remains is of the machine with them mounted, the force vector's RMS and peak with it; nothing is sized."""
    code, text, document = page(folder / "given.html", "-p", "AB=1kg", *MOUNTED)
    model = balance.load("four-bar").with_payload(AB=1.0)
    sizes = [
        np.linalg.norm(balance.simulate(one, "four-bar").force, axis=1)
        for one in (model, model.with_counter_mass(GIVEN))
    ]
    (of,) = document["payloads"]
    row, root = of["responses"][0], [float(np.sqrt(np.mean(one**2))) for one in sizes]
    assert row["component"] == "F_N"
    assert "|F| [N]" in text
    expected = [*root, *(one.max() for one in sizes)]
    assert [row[f"{what}_{side}"] for what in ("rms", "peak") for side in ("before", "after")] == pytest.approx(
        expected
    )
    assert of["remaining_percent"] == pytest.approx(100.0 * root[1] / root[0])
    assert {one["site"]: one["mass_kg"] for one in of["counter_masses"]} == GIVEN
    assert "given, not sized" in text
    mounted = ", ".join(f"{site} {mass:.4f} kg" for site, mass in GIVEN.items())
    assert text.count(f"<bdi>{mounted}</bdi>") == 2  # in the lead, and in the provenance
    assert code == 3
    assert "would balance it completely" in document["proof"]
    done = call(
        main, "balance", "report", "four-bar", "--motion", "four-bar", *MOUNTED, "--stock", "kiper2019", "-o", "x.html"
    )
    assert done.code == 2
    assert "--counter gives the masses, and --stock is for sizing them: leave one out" in done.err


@pytest.mark.parametrize(
    ("words", "fixed"), [((), False), (("--fixed",), True), (MOUNTED, True)], ids=["growing", "fixed", "given"]
)
def test_several_payloads_have_one_page(words, fixed, folder):
    """Sets as size finds them, and for each payload what the page of that payload alone with these masses has."""
    code, text, document = page(folder / "several.html", *LOADS, *words)
    assert "<h1>Counter-masses of four-bar, AB 1 / 2 kg</h1>" in text
    if words != MOUNTED:
        sized = call(main, "balance", "size", "four-bar", "--motion", "four-bar", *LOADS, *words, "--json")
        assert {name: sized.json[name] for name in document["sizing"]} == document["sizing"]
        assert sized.code == code
    assert document["one_set"] is fixed
    for of, mass in zip(document["payloads"], (1, 2), strict=True):
        masses = [word for one in of["counter_masses"] for word in ("-c", f"{one['site']}={one['mass_kg']!r}kg")]
        (alone,) = page(folder / "one.html", "-p", f"AB={mass}kg", *masses)[2]["payloads"]
        assert of["payload_kg"] == alone["payload_kg"] == {"AB": mass}
        for row, other in zip(of["responses"], alone["responses"], strict=True):
            assert row == pytest.approx(other, abs=1e-9)
        for row, other in zip(of["conditions"], alone["conditions"], strict=True):
            assert row == pytest.approx(other, abs=1e-12)
    pointers, found = Page(None, document), re.findall(r'<data value="([^"]*)" data-at="([^"]*)">', text)
    assert all(json.loads(value) == pointers.at(pointer) for value, pointer in found)
    for k in range(2):
        assert f"/payloads/{k}/responses/0/peak_after" in {pointer for _, pointer in found}


TOLERATED = ("--tolerance", "counter_A0A.mass=20g", "--tolerance", "B_AB.x=0.2mm")


def test_tolerances_on_the_page_are_those_of_tolerance(folder):
    """Of each payload, with its figure; one too wide is doubtful there too."""
    _, text, document = page(folder / "within.html", *LOADS, *MOUNTED, *TOLERATED)
    for k, mass in enumerate((1, 2)):
        words = ("four-bar", "--motion", "four-bar", "-p", f"AB={mass}kg", *MOUNTED, *TOLERATED)
        alone = call(main, "balance", "tolerance", *words, "--json").json
        found = document["payloads"][k]["tolerance"]
        assert {name: alone[name] for name in found} == found
        assert f'data-at="/payloads/{k}/tolerance/rms_percentiles_N/95"' in text
    assert text.count("Share of each tolerance in what errors add") == 2
    balance.write_report(
        balance.size_nested("four-bar", [{"AB": 1.0}, {"AB": 2.0}], "four-bar", given=GIVEN), folder / "python.html",
        {"counter_A0A.mass": "20 g", "B_AB.x": "0.2 mm"},
    )  # fmt: skip
    assert (folder / "python.html").read_text("utf-8") == text
    wide = page(folder / "wide.html", "-p", "AB=1kg", "--tolerance", "B_AB.x=60mm")
    assert wide[0] == 3
    assert "<strong>not_linear</strong>: B_AB.x ± 60 mm" in wide[1]


def test_a_page_of_several_payloads_in_a_browser(browser, serious, folder):
    """No request, nothing serious by axe, nothing wider than the window, tables there without script."""
    page(folder / "wide.html", *LOADS, *TOLERATED)
    for script in (True, False):
        context = browser.new_context(java_script_enabled=script, viewport={"width": 1000, "height": 800})
        shown, asked = context.new_page(), []
        shown.on("request", lambda one, asked=asked: asked.append(one.url))
        shown.goto((folder / "wide.html").as_uri())
        assert len(asked) == 1
        assert "AB 1 / 2 kg" in shown.title()
        assert shown.locator("#tolerances").is_visible()
        assert shown.locator(".wide table").count() == 8
        if script:
            assert serious(shown) == []
            assert shown.evaluate("document.documentElement.scrollWidth") <= 1000
            assert shown.pdf(format="A4").startswith(b"%PDF")
        context.close()
