"""No page has what a screen reader or weak eyes cannot use, light or dark."""

import shutil
import time
from importlib.resources import files

import pytest
from selenium.webdriver.support.ui import WebDriverWait

from tdac_agent.html_report import make_page
from tdac_agent.runs.replay import DEMO

SECONDS = 60
SERIOUS = {"serious", "critical"}
PAGES = {
    "start": "/",
    "runs": "/runs",
    "run": "/run?at=runs/demo",
    "compare": "/compare?one=runs/demo&other=runs/again",
    "worlds": "/worlds",
    "benches": "/benches",
    "unknown": "/nothing/here",
    "missing": "/run?at=runs/none",
}
COLOUR = "return getComputedStyle(document.body).backgroundColor"


@pytest.fixture(scope="module")
def filled(studio):
    """The studio with two runs."""
    for name in ("demo", "again"):
        shutil.copytree(DEMO, studio.place / "runs" / name)
    return studio


@pytest.fixture(params=["light", "dark"])
def window(browser, request):
    """A browser that prefers a scheme."""
    about = [{"name": "prefers-color-scheme", "value": request.param}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": about})
    yield browser
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def findings(window):
    """What axe finds, by rule, with the first element of each."""
    source = (files("axe_core_python") / "axe.min.js").read_text("utf-8")
    # Not as a script of the page, whose policy allows its own only.
    window.execute_cdp_cmd("Runtime.evaluate", {"expression": source})
    found = window.execute_async_script(
        "const done = arguments[arguments.length - 1];"
        "axe.run({ iframes: false }).then(done);"
    )
    return {
        each["id"]: [each["nodes"][0]["html"], each["nodes"][0]["failureSummary"]]
        for each in found["violations"]
        if each["impact"] in SERIOUS
    }


def settled(window):
    """Waits until nothing on the page changes any more."""

    def still(_):
        before = window.execute_script("return document.body.innerHTML.length")
        time.sleep(0.5)
        return before == window.execute_script("return document.body.innerHTML.length")

    WebDriverWait(window, SECONDS, 0.5).until(still)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_page_of_the_studio(window, filled, name):
    """Names for all parts, contrast, a language, headings."""
    window.get(filled.address)
    WebDriverWait(window, SECONDS).until(lambda b: "token" not in b.current_url)
    window.get(filled.base + PAGES[name])
    WebDriverWait(window, SECONDS).until(lambda b: b.title.endswith("tdac studio"))
    settled(window)
    assert findings(window) == {}
    assert window.execute_script("return document.querySelectorAll('h1').length") == 1


@pytest.mark.slow
def test_a_report(window, tmp_path):
    """The page of a run with several versions."""
    file = tmp_path / "report.html"
    file.write_bytes(make_page(DEMO).html)
    window.get(file.as_uri())
    settled(window)
    assert findings(window) == {}


def test_an_address_without_a_page_leads_back(browser, filled):
    """It says what there is."""
    browser.get(filled.address)
    WebDriverWait(browser, SECONDS).until(lambda b: "token" not in b.current_url)
    browser.get(f"{filled.base}/nothing/here")
    WebDriverWait(browser, SECONDS).until(
        lambda b: "There is no such page" in b.execute_script(
            "return document.body.innerText"
        )
    )  # fmt: skip
    assert "Nothing is at /nothing/here" in browser.page_source


@pytest.mark.parametrize("kind", ["run", "campaign", "bench"])
def test_what_is_missing_leads_to_its_list(browser, filled, kind):
    """In words that exist."""
    browser.get(filled.address)
    WebDriverWait(browser, SECONDS).until(lambda b: "token" not in b.current_url)
    browser.get(f"{filled.base}/{kind}?at=none")
    shown = {"bench": "All benches"}.get(kind, "All runs")
    WebDriverWait(browser, SECONDS).until(lambda b: b.find_elements("link text", shown))


def test_a_dark_page_is_never_white(window, filled):
    """Not before its scripts have run, either."""
    window.get(filled.address)
    WebDriverWait(window, SECONDS).until(lambda b: "token" not in b.current_url)
    settled(window)
    before = window.execute_script(COLOUR)
    window.execute_script("document.body.classList.remove('body--dark', 'body--light')")
    assert window.execute_script(COLOUR) == before


@pytest.mark.slow
def test_a_report_has_no_scroll_bar_of_its_own(browser, filled):
    """Its frame is as high as it is, and its links move the page around it."""
    browser.get(filled.address)
    WebDriverWait(browser, SECONDS).until(lambda b: "token" not in b.current_url)
    browser.get(filled.base + PAGES["run"])
    find = "document.querySelector('iframe.report')"
    WebDriverWait(browser, SECONDS).until(
        lambda b: b.execute_script(f"return ({find}?.clientHeight ?? 0) > 1500")
    )
    browser.switch_to.frame(browser.find_element("css selector", "iframe.report"))
    inner = browser.execute_script(
        "return [document.documentElement.scrollHeight, innerHeight]"
    )
    assert inner[0] <= inner[1] + 2
    browser.execute_script("document.querySelector('.cell:last-child').click()")
    browser.switch_to.default_content()
    WebDriverWait(browser, SECONDS).until(
        lambda b: b.execute_script("return scrollY") > 300
    )
