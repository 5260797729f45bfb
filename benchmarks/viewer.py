"""Panning a long run in the viewer: pictures a second, and how many of them show new samples from edge to edge.

Chromium drags the plot of a channel of ``--samples`` samples by hand, once per picture, at several widths of the view
and speeds [widths a second]; a picture counts as new where what is drawn reaches over the whole view. Needs Playwright.
"""

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

REQUIRED = 30.0
"""Pictures a second that show new samples."""
RATE_HZ = 10_000.0
VIEWS = ((100.0, 1.0), (100.0, 4.0), (20.0, 1.0), (20.0, 4.0), (0.5, 2.0))
"""Width of the view [s] and speed [widths/s]."""
SEEN = """(() => {
  const seen = window.seen = []; let real;
  const keep = (kind, given) => { const one = new kind(...given); seen.push(one); return one; };
  Object.defineProperty(window, "uPlot", {
    configurable: true, get: () => real, set: (made) => { real = new Proxy(made, { construct: keep }); },
  });
})()"""
"""What a page runs first: plots are kept where the benchmark sees them."""
DRAG = """async ([width, speed, seconds]) => {
  const u = seen.findLast((one) => one.root.isConnected), over = u.over, rect = over.getBoundingClientRect();
  const ends = seen.ends ??= [u.data[0][0], u.data[0][u.data[0].length - 1]];  // of the run, before the first drag
  const mouse = (kind, x, target) => target.dispatchEvent(new MouseEvent(kind,
    { bubbles: true, shiftKey: true, button: 0, clientX: x, clientY: rect.top + 50 }));
  const middle = ends[0] + 0.2 * (ends[1] - ends[0]);
  u.setScale("x", { min: middle, max: middle + width });
  await new Promise((done) => setTimeout(done, 1500));
  mouse("mousedown", rect.left, over);
  const begun = performance.now(); let frames = 0, fresh = 0;
  await new Promise((done) => {
    const frame = (now) => {
      const { min, max } = u.scales.x, time = u.data[0];
      if (frames && time[0] <= min && time[time.length - 1] >= max) fresh += 1;
      frames += 1;
      if (now - begun > 1000 * seconds) return done();
      mouse("mousemove", rect.left - (now - begun) / 1000 * speed * rect.width, over);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  });
  mouse("mouseup", rect.left, window);
  const passed = (performance.now() - begun) / 1000;
  return [frames / passed, fresh / passed];
}"""
SERVE = "from testbench.cli import main; import sys; sys.exit(main())"


def made(folder: Path, samples: int) -> None:
    """A campaign of one run, one channel of so many samples."""
    from testbench.recording import Channel, Group, UniformClock
    from testbench.store.writer import RunWriter

    rng = np.random.default_rng(1)
    group = Group("daq", (Channel("acc", "m/s^2"),), UniformClock(RATE_HZ))
    with RunWriter(folder, "long") as writer:
        for begin in range(0, samples, 1 << 20):
            time = np.arange(begin, min(begin + (1 << 20), samples)) / RATE_HZ
            writer.group(group).append([np.sin(40.0 * time) * np.sin(0.05 * time) + rng.normal(0.0, 0.1, len(time))])
        writer.group(group).finish(RATE_HZ, "declared")
        writer.describe("simulated", {}, [], {"sources": []}, None)
        writer.commit()


def main() -> int:
    """Print pictures and new pictures a second for each view; 1 where a view shows fewer new ones than required."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.viewer", description=__doc__)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each drag")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    from playwright.sync_api import sync_playwright

    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    slowest = float("inf")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        made(Path(folder) / "campaign", options.samples)
        command = [sys.executable, "-c", SERVE, "view", "campaign", "--no-browser", "--idle", "60"]
        with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            url = server.stdout.readline().split()[-1]
            browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1200, "height": 900})
            page.add_init_script(SEEN)
            page.goto(url)
            page.wait_for_selector("#series-plots canvas", timeout=60_000)
            for width, speed in VIEWS:
                if width * (1.0 + speed * options.seconds) > 0.7 * options.samples / RATE_HZ:
                    continue
                found = [page.evaluate(DRAG, [width, speed, options.seconds]) for _ in range(options.rounds)]
                frames, fresh = (statistics.median(column) for column in zip(*found, strict=True))
                slowest = min(slowest, fresh)
                print(f"view of {width:g} s, {speed:g} widths/s: {frames:.0f} pictures/s, {fresh:.0f} of them new")
            browser.close()
            server.terminate()
    return int(slowest < REQUIRED)


if __name__ == "__main__":
    raise SystemExit(main())
