"""The demonstration is for everybody: on any screen, by keyboard alone, and with a name for every control."""

import numpy as np
import pytest

from tests.browser import opened, title


def test_on_a_phone_the_room_is_in_sight_and_play_moves_the_robot_in_it(browser):
    browser.resize(390, 844)
    opened(browser, "view=robot")
    title(browser, "r-room")
    top, bottom = browser("['top', 'bottom'].map((end) => at('r-room').getBoundingClientRect()[end])")
    bar = browser("at('robot-play').getBoundingClientRect().top")
    assert 0 < top < bottom < bar
    before = browser("at('r-room').toDataURL()")
    browser.click("#robot-play")
    browser.until("robotView.steps.length > 2")
    assert browser("at('r-room').toDataURL()") != before
    assert browser("scrollY") == 0


@pytest.mark.parametrize("view", ["walk", "robot"])
def test_on_a_laptop_nothing_scrolls_but_the_page_and_the_buttons_stay_in_sight(browser, view):
    opened(browser, f"view={view}")
    assert browser("at('r-curve').getBoundingClientRect().bottom") <= 800
    scrolls = "e.scrollHeight > e.clientHeight + 1 && /auto|scroll/.test(getComputedStyle(e).overflowY)"
    assert browser(f"[...document.querySelectorAll('main *')].filter((e) => {scrolls}).map((e) => e.id)") == []
    browser("scrollTo(0, 500)")
    assert browser("scrollY") == 500
    assert 0 <= browser(f"at('{view}-play').getBoundingClientRect().top") < 100


def test_everything_can_be_done_by_keyboard(browser):
    opened(browser, "view=walk")
    browser("document.activeElement.blur()")
    browser.press("s", "s", "e")
    assert browser("walkView.walk.walks") == 1
    browser("at('w-trace').focus()")
    browser.press("ArrowLeft", "ArrowLeft")
    assert browser("walkView.chosen") == browser("walkView.steps.length") - 3
    browser("document.querySelector('nav button:last-child').focus()")
    browser.press("Enter")
    browser.until("state.view === 'robot' && robotView.experiment")
    browser("at('r-room').focus()")
    browser.press(*["ArrowRight"] * 2, "ArrowLeft", *["ArrowUp"] * 2, "ArrowDown", *[","] * 2, ".", "Enter")
    assert browser("state.start.split(',').map(Number)") == pytest.approx([0.27, 0.52, np.radians(-160)], abs=1e-3)
    browser.press("s", "s", "ArrowUp", "Enter")
    assert browser("state.kidnap").startswith("2:")
    for mode in ("play", None):
        browser.press(" ")
        assert browser("player.mode") == mode
    reached = "[...document.querySelectorAll('button, input, select, canvas[tabindex]')].map((e) => e.tabIndex)"
    assert set(browser(reached)) == {0}


@pytest.mark.parametrize("view", ["walk", "robot"])
def test_every_control_has_a_name(browser, view):
    opened(browser, f"view={view}&rule=own&own=x")
    shown = f"[...document.querySelectorAll('#{view} canvas')].filter((e) => e.offsetParent)"
    browser.until(f"{shown}.every((e) => e.getAttribute('aria-label'))")  # which they have once they are painted
    unnamed = browser(
        """[...document.querySelectorAll("button, input, select, canvas")].filter((e) => e.offsetParent)
        .filter((e) => !(e.textContent.trim() || e.labels?.length || e.getAttribute("aria-label")))
        .map((e) => e.id)"""
    )
    assert unnamed == []


@pytest.mark.parametrize("width", [390, 1280, 1920])
def test_nothing_is_wider_than_the_screen(browser, width):
    browser.resize(width, 844)
    for view in ("walk", "robot"):
        opened(browser, f"view={view}&rule=hestenes-stiefel:printed&at=30&made=30")
        assert browser("document.documentElement.scrollWidth") <= width
        sizes = browser(f"[...document.querySelectorAll('#{view} canvas')].map((canvas) => canvas.clientWidth)")
        assert min(sizes) > 0.4 * min(width, 900) - 60
