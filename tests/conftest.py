"""Tests that need real recordings wait where none are at hand; the end of the run says how many, and how to go on."""

import gc
import os
import shutil
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: a second thread costs many times what it brings
os.environ["COUNTERPOISE_CACHE"] = "off"  # what is tested is what MuJoCo says of a file, not what it once said
os.environ.pop("COLUMNS", None)  # lines of commands are as long as they are

import pytest
from hypothesis import settings

from testbench import public_recordings

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")

WAITS = "waits for real recordings"


def at_hand() -> bool:
    """Whether the recordings are: in the folder that the environment names, or all of them fetched.

    Fetched ones are named by the environment from then on, for this run and its processes.
    """
    cache = public_recordings.cache_folder()
    if public_recordings.FOLDER_VARIABLE not in os.environ and all(
        (cache / name).is_file() for name in public_recordings.recordings_by_file()
    ):
        os.environ[public_recordings.FOLDER_VARIABLE] = str(cache)
    return public_recordings.FOLDER_VARIABLE in os.environ


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what is marked ``recordings`` where there are none; ``malformed`` ones lie next to a folder of one's own."""
    good = at_hand()
    bad = good and (Path(os.environ[public_recordings.FOLDER_VARIABLE]).parent / "bad").is_dir()
    for item in items:
        marker = item.get_closest_marker("recordings")
        if marker is not None and not (bad if "malformed" in marker.args else good):
            item.add_marker(pytest.mark.skip(reason=WAITS))


def pytest_configure() -> None:
    """Garbage is collected seldom: as often as Python does it by itself it took a fifth of the time."""
    gc.set_threshold(50_000, 20, 20)
    gc.disable()


def pytest_collection_finish() -> None:
    """What is imported by now stays to the end: collections need not walk it, and none is made before."""
    gc.freeze()
    gc.enable()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line in place of a reason for each."""
    skipped = terminalreporter.stats.get("skipped", [])
    waiting = [report for report in skipped if WAITS in str(report.longrepr)]
    if waiting:
        terminalreporter.stats["skipped"] = [report for report in skipped if report not in waiting]
        terminalreporter.stats["waiting"] = waiting
        terminalreporter.write_line(
            f"{len(waiting)} tests wait for real recordings: fetch them by `testbench recordings fetch`, or name a "
            f"folder that holds them in {public_recordings.FOLDER_VARIABLE}"
        )


BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
AXE = Path(os.environ.get("COUNTERPOISE_AXE", "node_modules/axe-core/axe.min.js"))


@pytest.fixture(scope="session")
def browser():
    """Chromium of this machine."""
    library = pytest.importorskip("playwright.sync_api", reason="needs playwright to drive a browser")
    if BROWSER is None:
        pytest.skip("needs a browser: install Chromium, such as apt-get install chromium")
    with library.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def serious():
    """What axe finds serious on a page, light and dark; nothing where axe is not at hand."""

    def found(page) -> list[str]:
        wrong = []
        for scheme in ("light", "dark") if AXE.is_file() else ():
            page.emulate_media(color_scheme=scheme)
            page.evaluate(AXE.read_text("utf-8"))
            wrong += page.evaluate("axe.run()")["violations"]
        return [one["id"] for one in wrong if one["impact"] in ("serious", "critical")]

    return found
