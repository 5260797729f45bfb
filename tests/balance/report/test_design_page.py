"""The page of a design: numbers of `--json`, which are those of `balance size`; nothing measured is claimed."""

import json
import re

import pytest

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
    for i, _ in enumerate(document["responses"]):
        assert {f"/responses/{i}/{kind}_{side}" for kind in ("rms", "peak") for side in ("before", "after")} <= places
    assert "SIMULATED" in text
    assert document["verdict"] in text


def test_sizing_is_that_of_size(made):
    """The same counter-masses, residual and responses as the command that sizes."""
    sized = call(main, "balance", "size", "four-bar", "--motion", "four-bar", "--json").json
    assert {name: sized[name] for name in made[1]["sizing"]} == made[1]["sizing"]
    assert {"Fx_N", "Fy_N", "Mz_Nm"} <= {row["component"] for row in made[1]["responses"]}  # forces that are gone too
    for row in made[1]["responses"]:
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
