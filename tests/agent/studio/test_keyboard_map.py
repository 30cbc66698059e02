"""Start, goal and heading are set on the map by keys alone."""

import math

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

from tdac_agent.studio.draft import TaskDraft
from tdac_agent.studio.map_cursor import MapCursor
from tdac_agent.studio.source_view import view_of

SECONDS = 90


@pytest.fixture
def plan(tmp_path):
    """A room of 240 x 180 px with a pillar of 20 px in its middle."""
    picture = np.full((180, 240), 255, np.uint8)
    picture[:4] = picture[-4:] = picture[:, :4] = picture[:, -4:] = 0
    picture[80:100, 110:130] = 0
    cv2.imwrite(str(tmp_path / "plan.png"), picture)
    return tmp_path / "plan.png"


def test_a_cursor_on_a_map(plan):
    """By a pixel or ten, never over the edge; it knows what is there."""
    view = view_of("map", str(plan))
    cursor = MapCursor.on(view, (120.0, 60.0))
    assert cursor.told(view) == (
        "Cursor at 120, 60 px: free, 20 px from the nearest obstacle."
    )
    cursor = cursor.moved(view, "ArrowRight", far=False)
    cursor = cursor.moved(view, "ArrowDown", far=True).moved(
        view, "ArrowDown", far=True
    )
    assert cursor.place == (121.0, 80.0)
    assert cursor.told(view) == "Cursor at 121, 80 px: in an obstacle."
    for _ in range(20):
        cursor = cursor.moved(view, "ArrowRight", far=True)
    assert cursor.place == (239.0, 80.0)
    for _ in range(20):
        cursor = cursor.moved(view, "ArrowUp", far=True)
    assert cursor.place == (239.0, 0.0)
    assert MapCursor.on(view, None).place == (120.0, 90.0)


def test_a_cursor_in_a_world():
    """By a centimetre; up is up, though y points up there."""
    view = view_of("world", "maze")
    cursor = MapCursor.on(view, (0.1, 0.1))
    assert cursor.moved(view, "ArrowUp", far=False).place == (0.1, 0.11)
    assert cursor.moved(view, "ArrowLeft", far=True).place == (0.0, 0.1)
    assert cursor.told(view) == "Cursor at 0.1, 0.1 m."


def test_a_heading_turns_and_wraps():
    draft = TaskDraft("map", "maze", (1.0, 1.0), heading=math.radians(170))
    assert draft.turned(math.radians(15)).heading == pytest.approx(
        math.radians(-175), abs=1e-3
    )
    assert TaskDraft("map", "maze", (1.0, 1.0)).turned(0.5).heading == 0.5


def number(browser, name):
    field = browser.find_element(By.CSS_SELECTOR, f"input[aria-label='{name}']")
    return field.get_attribute("value")


def says(browser, text):
    """Waits until the line of the map, which is read out, says something."""
    line = ".beside [aria-live=polite]"
    WebDriverWait(browser, SECONDS, 0.1).until(
        lambda b: text in b.find_element(By.CSS_SELECTOR, line).text
    )


def becomes(browser, name, value):
    WebDriverWait(browser, SECONDS, 0.1).until(lambda b: number(b, name) == value)


@pytest.mark.slow
def test_places_are_set_by_keys_alone(browser, studio, plan):
    """Tab reaches the map; the page neither scrolls nor loses the browser's keys."""
    (studio.place / "keys.png").write_bytes(plan.read_bytes())
    browser.get(studio.address)
    WebDriverWait(browser, SECONDS).until(lambda b: "token" not in b.current_url)
    browser.get(f"{studio.base}/?source=map: keys.png")
    WebDriverWait(browser, SECONDS).until(
        lambda b: "240 x 180 px" in b.find_element(By.TAG_NAME, "body").text
    )

    def press(*keys, shift=False):
        actions = ActionChains(browser)
        if shift:
            actions.key_down(Keys.SHIFT)
        actions.send_keys(*keys)
        if shift:
            actions.key_up(Keys.SHIFT)
        actions.perform()

    focused = "return document.activeElement.className"
    for _ in range(80):
        if "keys" in browser.execute_script(focused).split():
            break
        press(Keys.TAB)
    assert "keys" in browser.execute_script(focused).split()
    described = browser.execute_script(
        "const id = document.activeElement.getAttribute('aria-describedby');"
        "return document.getElementById(id).textContent"
    )
    assert "places the start" in described
    scrolled = browser.execute_script("return scrollY")
    press("h")
    says(browser, "Place the start first.")
    press(*[Keys.ARROW_LEFT] * 4, shift=True)
    press(Keys.ARROW_UP)
    says(browser, "Cursor at 80, ")
    says(browser, "free, ")
    assert browser.find_elements(By.CSS_SELECTOR, ".board svg path.cursor")
    press("s")
    becomes(browser, "start x", "80")
    press(*[Keys.ARROW_RIGHT] * 8, shift=True)
    says(browser, "Cursor at 160, ")
    press("G")  # as with caps lock
    becomes(browser, "goal x", "160")
    press("h", "h")
    says(browser, "The heading is 30°.")
    press("h", shift=True)
    says(browser, "The heading is 15°.")
    becomes(browser, "heading, rad", "0.262")
    press(*[Keys.ARROW_DOWN] * 20)
    says(browser, "Cursor at 160, 109 px")
    assert browser.execute_script("return scrollY") == scrolled
    assert "keys" in browser.execute_script(focused).split()
