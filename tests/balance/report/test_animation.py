"""``balance animate``: a page or a video with a panel a design, or nothing."""

import json
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from balance.cli import main
from balance.front_door import follow, load
from balance.report import video
from balance.report.moving import designs_of, moving, pictures

from ...commands import call


@pytest.mark.parametrize("command", ["report", "animate"])
def test_another_ending_is_refused(command, tmp_path):
    """Before anything is computed; nothing is written."""
    done = call(main, "balance", command, "four-bar", "--motion", "four-bar", "-o", tmp_path / "page.gif")
    assert done.code == 2
    assert f"expected a name ending in .html{' or .mp4 or .png' if command == 'animate' else ''}" in done.err
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


@pytest.mark.parametrize(("ending", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_a_still_is_of_the_largest_force(ending, begins, tmp_path, monkeypatch):
    """Of the page's pictures that of the largest force without counter-masses; no video's library is needed."""
    monkeypatch.setattr(video, "find_spec", lambda _: None)
    drawn, real = [], video._drawn

    def seen(title, motion, frames, note):
        drawn.append((motion["panels"][0], *frames))
        return real(title, motion, frames, note)

    monkeypatch.setattr(video, "_drawn", seen)
    path = tmp_path / f"still.{ending}"
    words = ("animate", "four-bar", "--motion", "four-bar", "-c", "counter_A0A=1kg", "-o", path)
    assert call(main, "balance", *words).code == 0
    assert path.read_bytes().startswith(begins)
    ((without, frame),) = drawn
    assert without["label"] == "without counter-masses"
    assert without["force_N"][frame] == max(without["force_N"])


def test_a_video_without_its_library_is_refused(tmp_path, monkeypatch):
    """With the cure, before anything is computed."""
    monkeypatch.setattr(video, "find_spec", lambda _: None)
    done = call(main, "balance", "animate", "four-bar", "--motion", "four-bar", "-o", tmp_path / "four-bar.mp4")
    assert done.code == 1
    assert "pip install 'counterpoise[video]'" in done.err
    assert not list(tmp_path.iterdir())


def test_a_video_shows_what_the_page_shows(tmp_path):
    """As many pictures as the page has, a panel a design; the centre of mass is where its ring is, in every picture."""
    encoder = pytest.importorskip("imageio_ffmpeg", reason="needs imageio-ffmpeg to write a video")
    mechanism = load("four-bar")
    whole = follow(mechanism, "four-bar", "1 kHz")
    few = replace(whole, **{name: getattr(whole, name)[::300] for name in ("time", "q", "v", "a", "per_drive")})
    motion = moving("motion", few, designs_of(mechanism, {"counter_A0A": 1.0}))
    path = video.write_video(tmp_path / "own.mp4", "own \u202e", motion)
    decode = [encoder.get_ffmpeg_exe(), "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = np.frombuffer(subprocess.run(decode, capture_output=True, check=True).stdout, np.uint8)
    shown = raw.reshape(len(few.time), -1, 2 * 640, 3).astype(int)
    height = shown.shape[1]
    assert list(tmp_path.iterdir()) == [path]
    scale, top = 640 / motion["width"], height - 640 * motion["height"] / motion["width"]
    for k, panel in enumerate(motion["panels"]):
        ring = next(one["points"][0] for one in panel["shapes"] if one["kind"] == "centre")
        for picture, (x, y) in zip(shown, pictures(panel)[:, ring], strict=True):
            right, down = round(640 * k + scale * x), round(top + scale * y)
            near = picture[down - 9 : down + 10, right - 9 : right + 10]
            assert ((near[..., 0] - near[..., 1] > 60) & (near[..., 1] < 90)).any()  # dark red, as the ring alone is
