"""The browser that looks at pages."""

import shutil

import pytest

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def browser():
    """Chromium of this machine."""
    library = pytest.importorskip("playwright.sync_api", reason="needs playwright to drive a browser")
    if BROWSER is None:
        pytest.skip("needs a browser: install Chromium, such as apt-get install chromium")
    with library.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield chromium
        chromium.close()
