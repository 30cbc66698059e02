"""How quickly the studio shows things, and what its server needs.

    python -m benchmarks.studio [--runs 1000] [--opened 100]

In Chromium, headless: the time from the click on *Write and verify a controller* (maze,
`builtin`, compiled code cached) to the first candidate in the player; how soon the list
of many runs shows something, and then its rows, for the first time and again; memory of
the server before and after pages of runs have been opened one after another.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1440,900")
FIRST_PAINT = """
const paint = performance.getEntriesByName("first-contentful-paint")[0];
return paint ? paint.startTime / 1000 : null;
"""


def main() -> int:
    """Prints a line for each figure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studio")
    parser.add_argument("--runs", type=int, default=1000, help="runs in the list")
    parser.add_argument("--opened", type=int, default=100, help="pages of runs opened")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        subprocess.run(
            [sys.executable, "-m", "tdac_agent", "synth", "--out", "runs/maze-0"],
            cwd=place, check=True, capture_output=True,
        )  # fmt: skip
        with _served(place) as (process, address), _browser() as browser:
            browser.get(address)
            base = address.partition("/?")[0]
            _first_candidate(browser, base)
            for k in range(1, options.runs):
                shutil.copytree(place / "runs/maze-0", place / f"runs/copy-{k}")
            _listed(browser, base, "first")
            _listed(browser, base, "again")
            _memory(browser, base, process.pid, options.opened)
    return 0


def _first_candidate(browser: Any, base: str) -> None:
    browser.get(base)
    _wait(browser, lambda b: "A path of" in _text(b))
    path = "//button[.//span[normalize-space()='Write and verify a controller']]"
    button = browser.find_element(By.XPATH, path)
    _wait(browser, lambda _: button.is_enabled())
    began = time.perf_counter()
    browser.execute_script("arguments[0].click()", button)
    _wait(browser, _has_player)
    print(f"first candidate in the player: {time.perf_counter() - began:.1f} s")
    browser.switch_to.default_content()


def _has_player(browser: Any) -> bool:
    """Whether the report has a player; its frame is replaced when candidates arrive."""
    browser.switch_to.default_content()
    try:
        browser.switch_to.frame(browser.find_element(By.CSS_SELECTOR, "iframe.report"))
        return bool(browser.find_elements(By.CSS_SELECTOR, ".player .clock"))
    except WebDriverException:
        return False


def _listed(browser: Any, base: str, which: str) -> None:
    began = time.perf_counter()
    browser.get(f"{base}/runs")
    _wait(browser, lambda b: b.find_elements(By.CSS_SELECTOR, "tbody tr a"))
    rows = time.perf_counter() - began
    paint = browser.execute_script(FIRST_PAINT)
    print(f"list of runs, {which} time: first paint {paint:.2f} s, rows {rows:.1f} s")


def _memory(browser: Any, base: str, pid: int, count: int) -> None:
    before = _megabytes(pid)
    for k in range(1, count + 1):
        browser.get(f"{base}/run?at=runs/copy-{k}")
        _wait(browser, lambda b: b.find_elements(By.CSS_SELECTOR, "iframe.report"))
        if k in (1, count // 2, count):
            print(f"memory of the server after {k} pages: {_megabytes(pid):.0f} MB")
    print(f"memory of the server before: {before:.0f} MB")


def _megabytes(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert found
    return int(found[1]) / 1024


def _wait(browser: Any, condition: Callable[[Any], Any]) -> Any:
    return WebDriverWait(browser, 120, 0.05).until(condition)


def _text(browser: Any) -> str:
    return str(browser.execute_script("return document.body.innerText"))


@contextmanager
def _served(place: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", "studio", "--port", "0"],
        cwd=place, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert process.stdout
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.terminate()
        process.wait()


@contextmanager
def _browser() -> Iterator[Any]:
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in FLAGS:
        options.add_argument(flag)
    service = Service(shutil.which("chromedriver"))
    browser = webdriver.Chrome(options=options, service=service)
    try:
        yield browser
    finally:
        browser.quit()


if __name__ == "__main__":
    sys.exit(main())
