"""The page, in a real browser: what a person edits, drags and clicks, and what is shown then."""

import math

import pytest

from tests.watch.conftest import BLOCK, LAG, Watch, until


def figure(page, metric: str) -> float:
    """The value of a metric, as the page shows it."""
    return float(page.locator("#metrics tr", has_text=metric).locator("td.number").first.inner_text())


def shows(page, metric: str, value: float) -> None:
    """Wait until the page shows a value, in its four digits."""
    until(lambda: figure(page, metric) == float(f"{value:.4g}"), f"{metric} = {value:.4g}")


def says(page, place: str, text: str) -> None:
    """Wait until a part of the page has a text: parts are drawn one after the other."""
    until(lambda: text in page.locator(place).inner_text(), f"`{text}` in {place}")


def at(time: float, T: float) -> float:
    """The lag's answer to a step: x = 1 - exp(-t / T)."""
    return 1.0 - math.exp(-time / T)


def test_edit_break_mend(lag, see):
    with Watch(lag, "lag.yaml") as watch:
        page = see(watch.address)
        shows(page, "at_T", at(0.5, 0.5))
        assert page.locator("#status").inner_text() == "completed"
        assert page.locator("h1").inner_text() == "A lag <b>of first order</b>"  # as text

        (lag / "lag.yaml").write_text(LAG.replace("T: 0.5", "T: 2"))
        shows(page, "last", at(4, 2))
        row = page.locator("#metrics tr", has_text="last")
        change = 100 * (at(4, 2) / at(4, 0.5) - 1)
        until(lambda: f"{change:.1f} %" in row.inner_text())
        says(page, "#requirements", "kept → violated")

        broken = LAG.replace("T: 0.5", "T: 0.5, S: 1")
        (lag / "lag.yaml").write_text(broken)
        page.wait_for_selector("#mistakes .mistake")
        line = 1 + broken[: broken.index("S: 1")].count("\n")
        column = broken.split("\n")[line - 1].index("S: 1") + 1
        said = page.locator("#mistakes").inner_text()
        assert f"lag.yaml:{line}:{column}" in said and "has no parameter `S`" in said
        rows = page.locator("#mistakes pre").inner_text().split("\n")
        marked = next(k for k, row in enumerate(rows) if "S: 1" in row)
        assert rows[marked].split()[0] == str(line) and rows[marked + 1].index("^") == rows[marked].index("S: 1")
        assert figure(page, "last") == float(f"{at(4, 2):.4g}")  # the last good picture stays
        assert page.locator("#drawing svg").count() == 1

        (lag / "lag.yaml").write_text(LAG)
        page.wait_for_selector("#mistakes", state="hidden")
        shows(page, "last", at(4, 0.5))


def test_a_block_that_is_edited_runs_as_it_is_now(lag, see):
    with Watch(lag, "lag.yaml") as watch:
        page = see(watch.address)
        shows(page, "last", at(4, 0.5))
        (lag / "lag.py").write_text(BLOCK.replace("(u - x)", "(3.0 * u - x)"))
        shows(page, "last", 3 * at(4, 0.5))
        (lag / "lag.py").write_text(BLOCK.replace("(u - x)", "(u - nothing)"))
        page.wait_for_selector("#mistakes .mistake")
        line = 1 + BLOCK[: BLOCK.index("(u - x)")].count("\n")
        assert f"lag.py:{line}:" in page.locator("#mistakes").inner_text()


def test_sliders_change_the_run_and_not_the_file(lag, see):
    with Watch(lag, "lag.yaml") as watch:
        page, other = see(watch.address), see(watch.address, 1920, dark=True)
        slider = page.locator("[data-path='blocks.lag.parameters.T'] input[type=range]")
        box = page.locator("[data-path='blocks.lag.parameters.T'] input[type=number]")
        slider.focus()
        page.keyboard.press("End")  # of 0 to twice the value
        assert box.input_value() == "1"
        shows(page, "at_T", at(0.5, 1))
        shows(other, "at_T", at(0.5, 1))
        says(page, "#kept", "--set blocks.lag.parameters.T=1.0")
        says(page, "#kept", "parameters: {T: 1.0}")
        theirs = other.locator("[data-path='blocks.lag.parameters.T'] input[type=number]")
        until(lambda: float(theirs.input_value()) == 1)
        box.fill("4")
        box.press("Enter")
        shows(page, "last", at(4, 4))
        assert (lag / "lag.yaml").read_text() == LAG
        page.locator("#kept button", has_text="back to the file").click()
        shows(page, "last", at(4, 0.5))
        box.fill("-1")
        box.press("Enter")
        page.wait_for_selector("#mistakes .mistake")
        says(page, "#mistakes", "--set blocks.lag.parameters.T=-1.0")


def test_a_block_that_is_clicked_shows_its_ports_and_values(lag, see):
    with Watch(lag, "lag.yaml", "--set", "metrics.at_T=~", "--set", "record=~") as watch:
        page = see(watch.address)
        page.locator("[data-block=lag]").click()
        said = page.locator("#block")
        said.locator("table").first.wait_for()
        text = said.inner_text()
        assert "T dx/dt = u - x." in text and "what lags" in text and "0.5000" in text
        assert f"{at(4, 0.5):.4g}" in text and "t = 4 s" in text
        assert page.locator(".plot").count() == 1  # nothing is recorded: what a metric looks at is


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1920, True)])
def test_the_page_fits_and_has_both_colours(lag, see, width, dark):
    with Watch(lag, "lag.yaml") as watch:
        page = see(watch.address, width, dark)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        red, *_ = page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
        assert (red < 64) if dark else (red > 192)
        inked = (
            "c => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; return d.some(v => v) }"
        )
        assert page.locator(".plot canvas").evaluate(inked)
