"""The page of a campaign: its numbers are those of ``--json``, its texts are texts, it asks nobody for anything."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

import testbench.report
from balance.report.page import Page
from testbench.cross_examination import hear
from testbench.recording import Finding
from testbench.report.campaign_page import NOTHING_TO_ACCEPT, CampaignReport
from testbench.report.run_report import RunReport
from testbench.store import open_campaign

from ...commands import assert_fits
from ..conftest import PAIR, call

HOSTILE = "<script>document.title='x'</script>\"'&\u202egnp.</style>{{7*7}}"


class Parsed(HTMLParser):
    """Numbers with their place in the document, elements, and what a reader sees."""

    def __init__(self, text):
        super().__init__()
        self.numbers, self.elements, self.text, self._open, self._apart = [], [], [], None, 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        """An element begins."""
        given = dict(attributes)
        self.elements.append((tag, given))
        self._apart += tag in ("script", "style")
        if "data-at" in given:
            self._open = [given.get("value"), given["data-at"], ""]

    def handle_endtag(self, tag):
        """An element ends."""
        self._apart -= tag in ("script", "style")
        if self._open and tag in ("data", "span"):
            self.numbers.append(tuple(self._open))
            self._open = None

    def handle_data(self, data):
        """Text."""
        if not self._apart:
            self.text.append(data)
        if self._open:
            self._open[2] += data


@pytest.fixture(scope="module")
def told(shared, tmp_path_factory):
    """A page of one condition, the document that its command prints, and its sentences; computed once for both."""
    campaign, kept, whole = shared(PAIR).campaign, [], testbench.report.campaign_report
    path = tmp_path_factory.mktemp("page") / "report.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "80")
        patch.setattr(
            "testbench.report.campaign_report",
            lambda *a, **b: kept[0] if kept else kept.append(whole(*a, **b)) or kept[0],
        )
        document, text = (
            call("report", campaign, "-o", path, "--published", "kiper2019", words) for words in ("--json", "--all")
        )
    assert document.code == text.code == 0, document.err
    return (campaign, path, document.json), text.out


@pytest.fixture(scope="module")
def made(told):
    """Campaign, page, document."""
    return told[0]


@pytest.fixture(scope="module")
def page(made):
    """What is on the page."""
    return Parsed(made[1].read_text("utf-8"))


@pytest.fixture(scope="module")
def hostile(made):
    """The same page of a campaign, run, sensor, channel, site and motion with hostile names, and a mass at a site."""
    _, path, document = made
    data = json.loads(re.search(r'id="page-data">(.*?)</script>', path.read_text("utf-8"), re.DOTALL)[1])

    def renamed(value, key=""):
        if isinstance(value, dict):
            return {renamed(name): renamed(one, name) for name, one in value.items()}
        if isinstance(value, list):
            return [renamed(one) for one in value]
        if not isinstance(value, str) or key in ("values", "points"):  # of the script: numbers in base64
            return value
        return HOSTILE if value == "x" else re.sub("base_acc|counter_A0A|r001|motor_A0", lambda _: HOSTILE, value)

    from testbench.report import campaign_page as module

    labels = {renamed(run["run"]): renamed(run["run"]) for run in document["runs"]}
    about = {"sections": module.SECTIONS, "figure": "", "pictures": [], "calibrations": [HOSTILE], "labels": labels}
    about["lacking"] = [(HOSTILE, HOSTILE, HOSTILE)]
    template = Path(module.__file__).with_name("campaign.html")
    changed = renamed(document) | {"campaign": HOSTILE}
    changed["trim"][0]["payloads_kg"] = {HOSTILE: 3.0}
    return Page(template, changed, renamed(data), about).write(path.with_name("hostile.html"))


def test_every_number_is_the_documents(made, page):
    """Each stands where the document has it, to the digits that are shown; no reduction is missing."""
    _, _, document = made
    pointers = Page(Path(), document)
    assert len(page.numbers) > 150
    for value, pointer, text in page.numbers:
        known = pointers.at(pointer)
        if known is None:
            assert text == "-"
            continue
        assert json.loads(value) == known
        digits = re.fullmatch(r"-?\d+(?:\.(\d+))?(?:e([+-]\d+))?", text)
        assert abs(float(text) - known) <= 0.5000001 * 10.0 ** (int(digits[2] or 0) - len(digits[1] or ""))
    places = {pointer for _, pointer, _ in page.numbers}
    for i, row in enumerate(document["comparison"]["rows"]):
        names = ["simulated_percent", "published_percent", "amplitude_m_s2/with", "amplitude_m_s2/without"]
        names += ["at_least_percent"] if row["limit"] == "at_least" else ["reduction_percent"]
        names += ["interval_percent/0", "interval_percent/1"] if row["interval_percent"] else []
        assert {f"/comparison/rows/{i}/{name}" for name in names} <= places


def test_open_is_what_a_person_can_accept(made):
    """A contradiction is open, and what ingest found of a run; what follows from the numbers is stated with them."""
    run = open_campaign(made[0]).runs[0]
    codes = ("repeats_differ", "copied_run", run.findings[0].code)
    one = RunReport(run, {"torque": {}}, tuple(Finding(code, None, run.name, code) for code in codes))
    found = CampaignReport("page", (run,), "none", hear([]), (), {run.name: one}, {}, ()).document["findings"]
    assert {f["code"]: f["decision"] for f in found} == dict.fromkeys(codes[1:], "open") | {codes[0]: NOTHING_TO_ACCEPT}
    assert found[-1]["code"] == "repeats_differ"


def test_the_document_is_that_of_the_commands(made):
    """Reductions as compare has them, contradictions as doctor has them."""
    campaign, _, document = made
    compared = call("compare", campaign, "--published", "kiper2019", "--json").json
    for ours, theirs in zip(document["comparison"]["rows"], compared["rows"], strict=True):
        assert {name: ours[name] for name in theirs} == theirs
    examined = call("doctor", campaign, "--json").json
    assert {run["run"]: run for run in document["examination"]["runs"]} == {r["run"]: r for r in examined["runs"]}
    assert document["examination"]["verdict"] == examined["verdict"]


def test_reads_without_script(made, page):
    """The verdict, that all is simulated, that the original logs are not available; headers have a scope."""
    text = " ".join("".join(page.text).split())
    assert made[2]["verdict"] in text
    assert "SIMULATED: 2 of 2 runs are simulated" in text
    assert "The original logs of the manipulator tests are not available" in text
    assert all("scope" in given for tag, given in page.elements if tag == "th")
    assert all("aria-label" in given for tag, given in page.elements if tag == "svg")
    assert sum(tag == "caption" for tag, _ in page.elements) == sum(tag == "table" for tag, _ in page.elements)
    for run in open_campaign(made[0]).runs:
        assert run.provenance["sources"][0]["sha256"] in text


def test_sentences_fit(told):
    """The verdict comes first; words alone are broken at."""
    assert told[0][2]["verdict"] in " ".join(told[1].split())
    assert_fits(told[1])


def test_no_address_is_asked_for(page):
    """Nothing on the page has an address outside it."""
    for tag, given in page.elements:
        for name in ("src", "href", "xlink:href", "action", "data"):
            assert given.get(name, "#").startswith("#"), (tag, given)
    (policy,) = [given["content"] for _, given in page.elements if given.get("http-equiv")]
    assert policy.startswith("default-src 'none'")


def test_hostile_names_are_text(hostile, page):
    """Neither elements nor scripts arise from names, and directions of writing end with the name."""
    text = hostile.read_text("utf-8")
    found = Parsed(text)
    assert sum(tag == "script" for tag, _ in found.elements) == sum(tag == "script" for tag, _ in page.elements)
    assert "\u202e" not in "".join(found.text)
    assert HOSTILE.replace("\u202e", "\\x202e") in "".join(found.text)
    for block in re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL):
        assert "<" not in block
        assert "\\u202e" not in json.dumps(json.loads(block))


def test_payloads_of_a_mounting_are_in_one_list(hostile):
    """The heading says once that they are payloads."""
    text = "".join(Parsed(hostile.read_text("utf-8")).text)
    assert re.search(r"Payload [\d.]+ kg, 3 kg at [^,]*, counter-masses", text)


def test_of_a_campaign_that_is_open(made, tmp_path):
    """As of its folder."""
    written = testbench.report.html_report(open_campaign(made[0]), tmp_path / "page.html")
    assert written.read_text("utf-8").startswith("<!DOCTYPE html>")


def test_runs_that_cannot_be_compared_have_a_page(made, tmp_path):
    """One run alone: the reason in place of reductions, and all that the run shows by itself."""
    done = call("report", made[0] / "r001.h5", "-o", tmp_path / "one.html")
    text = (tmp_path / "one.html").read_text("utf-8")
    assert done.out.startswith("r001: No reduction: ")
    assert "no two runs can be compared" in text
    assert "Shaking force" in text


@pytest.mark.parametrize("which", ["made", "hostile"])
def test_in_a_browser(browser, serious, made, hostile, tmp_path, which):
    """Loads, plays, zooms, filters, prints; no error, no request; names stay text; axe finds nothing serious."""
    path = made[1] if which == "made" else hostile
    view = browser.new_page()
    odd, asked = [], []
    view.on("console", lambda message: odd.append(message.text))
    view.on("pageerror", lambda error: odd.append(str(error)))
    view.on("request", lambda request: asked.append(request.url))
    view.goto(path.as_uri())
    links = "#motion-panels .link, #motion-panels .payload"
    before = view.eval_on_selector_all(links, "all => all.map(one => one.getAttribute('points'))")
    view.fill("#motion-time", "40")
    assert view.eval_on_selector_all(links, "all => all.map(one => one.getAttribute('points'))") != before
    view.click("#motion-play")
    view.wait_for_function("() => document.getElementById('motion-time').value != '40'")
    view.click("#motion-play")
    assert view.locator("#series-plots canvas").count() == 3
    view.wait_for_function("() => document.querySelector('#series-plots p').textContent")
    whole = view.inner_text("#series-plots p >> nth=0")
    view.focus("#series-plots .plot >> nth=0")
    view.keyboard.press("+")
    view.wait_for_function("old => document.querySelector('#series-plots p').textContent != old", arg=whole)
    view.keyboard.press("0")
    view.wait_for_function("old => document.querySelector('#series-plots p').textContent == old", arg=whole)
    view.select_option("#series-over", "frequency")
    assert view.locator("#series-plots canvas").count() == 3
    view.fill("[data-filters]", "no such row")
    assert view.locator("#reductions-table tbody tr:visible").count() == 0
    view.fill("[data-filters]", "")
    assert which != "made" or serious(view) == []
    assert view.pdf(path=tmp_path / "report.pdf").startswith(b"%PDF")
    assert view.title() != "x"
    assert odd == []
    assert asked == [path.as_uri()]
    view.close()
