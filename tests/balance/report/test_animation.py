"""``balance animate``: a page with a panel a design, or nothing."""

import json
import re

import pytest

from balance.cli import main

from ...commands import call


@pytest.mark.parametrize("command", ["report", "animate"])
def test_another_ending_is_refused(command, tmp_path):
    """Before anything is computed; nothing is written."""
    done = call(main, "balance", command, "four-bar", "--motion", "four-bar", "-o", tmp_path / "page.pdf")
    assert done.code == 2
    assert "expected a name ending in .html" in done.err
    done = call(main, "balance", command, "four-bar", "--motion", "four-bar", "-o", tmp_path / "none" / "page.html")
    assert done.code == 1
    assert "there is no folder" in done.err
    assert not list(tmp_path.iterdir())


def test_a_panel_a_design(tmp_path):
    """With counter-masses side by side, simulated and said so, and nothing left over from writing."""
    words = ("animate", "four-bar", "--motion", "four-bar", "-c", "counter_A0A=1kg", "-o", tmp_path / "page.html")
    assert call(main, "balance", *words).code == 0
    (page,) = tmp_path.iterdir()
    text = page.read_text("utf-8")
    data = json.loads(re.search(r'id="page-data">(.*?)</script>', text)[1])
    labels = [panel["label"] for panel in data["motions"][0]["panels"]]
    assert labels == ["without counter-masses", "with counter-masses"]
    assert "SIMULATED" in text
