"""The page in a real browser: no errors, controls that work, no word cut off."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report import make_page

WIDTHS = {"desktop": 1280, "phone": 390}
# Right end, and middle of the height, of what has the colour of movers; parts of both.
MOVER_END = """
const canvas = document.querySelector(".player canvas"), { width, height } = canvas;
const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
let count = 0, x = 0, y = 0;
for (let i = 0; i < width * height; i++) {
  const near = [176, 58, 120].every((c, k) => Math.abs(data[4 * i + k] - c) < 40);
  if (near) { count++; x = Math.max(x, i % width); y += Math.floor(i / width); }
}
return [x / width, y / count / height];
"""
# Tables of episodes that must be scrolled, and controls outside of their section.
CUT = """
const tables = [...document.querySelectorAll(".scroll:has(> .episodes)")];
const controls = [...document.querySelectorAll(".player :is(select, input, button)")];
const end = (part) => part.getBoundingClientRect().right;
return [
  ...tables.filter((part) => part.scrollWidth > part.clientWidth),
  ...controls.filter((part) => end(part) > end(part.closest("section")) - 20),
].map((part) => part.outerHTML);
"""
PICTURE = "return document.querySelector(arguments[0] + ' canvas').toDataURL()"


@pytest.fixture(params=WIDTHS)
def opened(request, browser, page, tmp_path):
    """The report in a window of some width; afterwards nothing was complained about."""
    width = WIDTHS[request.param]
    size = {"width": width, "height": 900, "deviceScaleFactor": 1}
    mobile = {"mobile": request.param == "phone"}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size | mobile)
    file = tmp_path / "report.html"
    file.write_text(page)
    browser.get(file.as_uri())
    yield browser
    assert browser.get_log("browser") == []
    assert browser.execute_script("return typeof window.hacked") == "undefined"


@pytest.fixture
def moving(copied):
    """The verified run; in its first episode, a disc drives to the right."""
    file = copied / "iterations" / "k01" / "j0" / "trajectories" / "nominal.npz"
    trajectory = Trajectory.load(file)
    x = np.linspace(20.0, 140.0, trajectory.steps + 1)
    discs = np.column_stack([x, np.full_like(x, 100.0), np.full_like(x, 5.0)])
    replace(trajectory, movers=discs[:, None].astype(np.float32)).save(file)
    return copied


def find(browser, selector):
    return browser.find_element(By.CSS_SELECTOR, selector)


def click(browser, selector):
    browser.execute_script(
        "arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})",
        found := find(browser, selector),
    )
    found.click()


def until(browser, condition):
    return WebDriverWait(browser, 30, poll_frequency=0.05).until(condition)


@pytest.mark.slow_after(1)
def test_it_fits(opened):
    """Nothing makes the page wider than the window, and text is not tiny."""
    for part in opened.find_elements(By.CSS_SELECTOR, "details"):
        opened.execute_script("arguments[0].open = true", part)
    width = opened.execute_script("return document.documentElement.scrollWidth")
    assert width == opened.execute_script("return document.documentElement.clientWidth")
    size = "return parseFloat(getComputedStyle(arguments[0]).fontSize)"
    for selector in ("p", "td", "pre.code", "button", ".diagnosis", ".message"):
        assert opened.execute_script(size, find(opened, selector)) >= 12


@pytest.mark.slow_after(1)
def test_tables_of_episodes_are_wholly_in_sight(opened):
    """On a screen none has to be scrolled, and no control leaves its section."""
    for part in opened.find_elements(By.CSS_SELECTOR, "details"):
        opened.execute_script("arguments[0].open = true", part)
    for width in (1024, 1196, 1440):
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        assert opened.execute_script(CUT) == []


@pytest.mark.slow_after(1)
def test_charts_are_dark_where_the_page_is(opened):
    """Their white would be the brightest part of the page."""
    lightness = {}
    for scheme in ("light", "dark"):
        about = [{"name": "prefers-color-scheme", "value": scheme}]
        opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": about})
        chart = find(opened, ".charts img")
        opened.execute_script("arguments[0].scrollIntoView({block: 'center'})", chart)
        shown = cv2.imdecode(np.frombuffer(chart.screenshot_as_png, np.uint8), 0)
        lightness[scheme] = np.median(shown)
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert lightness["light"] == 255
    assert lightness["dark"] < 60


@pytest.mark.slow
def test_the_player(opened):
    """Plays, pauses, is dragged, and shows the episode that is chosen."""
    player = "#run-2 .player"

    def step():
        return int(find(opened, f"{player} .scrub").get_property("value"))

    def picture():
        return opened.execute_script(PICTURE, player)

    steps = int(find(opened, f"{player} .scrub").get_attribute("max"))
    assert step() == steps
    assert "– reached" in find(opened, f"{player} .clock").text
    at_the_end = picture()
    # So slow that a busy machine pauses it before its end.
    slow = "arguments[0].value = '0.05'"
    opened.execute_script(slow, find(opened, f"{player} .speed option"))
    Select(find(opened, f"{player} .speed")).select_by_value("0.05")
    click(opened, f"{player} .play")
    until(opened, lambda _: 0 < step() < steps)
    click(opened, f"{player} .play")
    assert find(opened, f"{player} .play").get_attribute("aria-label") == "Play"
    assert picture() != at_the_end
    drag = "arguments[0].value = 20; arguments[0].dispatchEvent(new Event('input'))"
    opened.execute_script(drag, find(opened, f"{player} .scrub"))
    assert find(opened, f"{player} .clock").text.startswith("step 20 of ")
    Select(find(opened, f"{player} .candidate")).select_by_visible_text("iteration 1")
    names = Select(find(opened, f"{player} .episode")).options
    assert [name.text for name in names] == ["nominal: collision"]
    assert "– collision" in find(opened, f"{player} .clock").text
    Select(find(opened, f"{player} .speed")).select_by_value("16")
    click(opened, f"{player} .play")
    until(opened, lambda _: "collision" in find(opened, f"{player} .clock").text)


@pytest.mark.slow_after(1)
def test_ways_through_the_page(opened):
    """A cell of the timeline opens its candidate, whose episodes can be watched."""
    click(opened, '#run-1 a.cell[href="#c-1-1-1"]')
    assert until(opened, lambda _: find(opened, "#c-1-1-1").is_displayed())
    click(opened, "#run-1 button.all")
    parts = opened.find_elements(By.CSS_SELECTOR, "#run-1 details.iteration")
    assert all(part.get_attribute("open") for part in parts)
    click(opened, "#run-1 button.all")
    assert not any(part.get_attribute("open") for part in parts)
    click(
        opened,
        '#run-2 button.watch[aria-label="Watch jitter 2 of iteration 1, repair 1"]',
    )
    chosen = Select(find(opened, "#run-2 .episode")).first_selected_option.text
    assert chosen == "jitter 2: reached"
    until(opened, lambda _: "reached" in find(opened, "#run-2 .clock").text)


def test_movers(browser, moving, tmp_path):
    """The player draws them at their places of the step that is shown."""
    file = tmp_path / "report.html"
    file.write_bytes(make_page(moving).html)
    browser.get(file.as_uri())
    Select(find(browser, ".player .candidate")).select_by_visible_text("iteration 1")
    steps = int(find(browser, ".player .scrub").get_attribute("max"))
    drag = (
        "arguments[0].value = arguments[1];"
        "arguments[0].dispatchEvent(new Event('input'))"
    )
    ends = []
    at = (0, steps // 2, steps)
    for step in at:
        browser.execute_script(drag, find(browser, ".player .scrub"), step)
        ends.append(browser.execute_script(MOVER_END))
    # Of 160 x 120 px; its trail is to the left of it.
    for (x, y), step in zip(ends, at, strict=True):
        assert x * 160 == pytest.approx(25 + 120 * step / steps, abs=2)
        assert y * 120 == pytest.approx(100, abs=2)
    # Chromium warns of the pixels that this test reads.
    log = browser.get_log("browser")
    assert [entry for entry in log if entry["level"] != "WARNING"] == []
