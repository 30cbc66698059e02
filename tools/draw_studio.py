"""Draws `docs/studio.png`: the first page of the studio, in Chromium.

Usage: python -m tools.draw_studio [FILE]

It needs the extra `studio`, selenium (extra `test`), and Chromium with its driver.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

WIDTH, HEIGHT = 980, 694
SECONDS = 90


def main() -> None:
    """Starts a studio in an empty folder, opens it, and takes a picture."""
    file = Path(sys.argv[1] if sys.argv[1:] else "docs/studio.png").resolve()
    with tempfile.TemporaryDirectory() as name:
        place = Path(name) / "robots"
        place.mkdir()
        words = [sys.executable, "-m", "tdac_agent", "studio", "--port", "0"]
        studio = subprocess.Popen(words, cwd=place, stdout=subprocess.PIPE, text=True)
        assert studio.stdout is not None
        try:
            _take(studio.stdout.readline().strip(), file)
        finally:
            studio.terminate()
            studio.wait()
            studio.stdout.close()


def _take(address: str, file: Path) -> None:
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
    ):
        options.add_argument(flag)
    driver = Service(shutil.which("chromedriver"))
    browser = webdriver.Chrome(options=options, service=driver)
    try:
        browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False},
        )
        browser.get(address)
        # The marks of start and goal come last.
        marks = By.CSS_SELECTOR, ".board svg circle"
        WebDriverWait(browser, SECONDS).until(lambda page: page.find_elements(*marks))
        time.sleep(1.0)  # until the fonts and the picture are drawn
        browser.save_screenshot(str(file))
    finally:
        browser.quit()


if __name__ == "__main__":
    main()
