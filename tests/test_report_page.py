"""The page: what stands in it, and what a reader sees of it in headless Chromium."""

from __future__ import annotations

import contextlib
import json
import re

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from made_results import MADE_AGENTS, NASTY, edit_records, make_result

from mazebench.maps.benchmark import load_kind_mazes
from mazebench.report.write_report import write_report
from mazebench.world.ray_casting import Lidar


@pytest.fixture(scope="module")
def page(report):
    return report / "report.html"


def data_of(page):
    return json.loads(page.read_text().split('id="data">')[1].split("</script>")[0])


class TestContent:
    def test_the_page_asks_no_network_for_anything(self, page):
        text = page.read_text()
        assert not re.search(r"https?://", text)
        assert "default-src 'none'" in text

    def test_an_agent_named_like_a_script_is_shown_as_text(self, page):
        text = page.read_text()
        assert "window.hacked=1</script>" not in text
        assert "<img src=x" not in text
        assert NASTY in [result["label"] for result in data_of(page)["results"]]
        for path in (page.parent / "tables").glob("*.md"):
            assert not re.search(r"(?<!\\)<", path.read_text())


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed")
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@contextlib.contextmanager
def loaded(browser, page):
    """The browser with the page loaded anew and an episode in the explorer; checks that the page raised no error."""
    browser.errors.clear()
    browser.open(page)
    browser.wait_for("document.getElementById('clock').value.startsWith('step')")
    yield browser
    assert browser.errors == []
    assert browser.run("window.hacked === undefined")


@pytest.fixture
def opened(browser, page):
    with loaded(browser, page):
        yield browser


PIXELS = "document.getElementById('driven').toDataURL()"


def set_value(name, value, event="change"):
    return (
        f"(() => {{ const node = document.getElementById('{name}'); node.value = '{value}';"
        f"node.dispatchEvent(new Event('{event}')); }})()"
    )


def choose_setting(browser, ending):
    options = "[...document.getElementById('setting').options]"
    browser.run(set_value("setting", browser.run(f"{options}.find(o => o.text.endsWith('{ending}')).value")))


@pytest.fixture(scope="module")
def track_page(tmp_path_factory):
    """The page over results on tracks, and one of the benchmark's first version without lidar."""
    folder = tmp_path_factory.mktemp("tracks")
    for agent in ("mah", "random"):
        here = folder / "results" / agent
        for level in (1, 2):
            make_result(here / f"adrift-{level}", agent, skill=0.8, task="adrift", level=level, num_mazes=2)
        make_result(here / "rough", agent, skill=0.8, task="rough", num_mazes=1)
        make_result(here / "local", agent, num_mazes=2)
        rebuilt = make_result(here / "rebuilt", agent, skill=0.9, task="rebuilt", num_mazes=4)
        edit_records(rebuilt, lambda record: record | {"blocked": record["episode"] % 4 == 0})
    write_report([folder / "results"], folder / "report")
    return folder / "report" / "report.html"


@pytest.fixture
def on_tracks(browser, track_page):
    with loaded(browser, track_page):
        yield browser


def is_seen(name):
    return f"document.getElementById('{name}').checkVisibility()"


class TestTracks:
    def test_failures_are_found_by_track_level_and_group(self, on_tracks):
        choose_setting(on_tracks, "rebuilt, level 1, 31 × 31")
        on_tracks.wait_for(is_seen("group"))
        on_tracks.run(set_value("group", "blocked"))
        assert on_tracks.run("document.getElementById('count').textContent") == "5 of 20 episodes"
        on_tracks.run("document.getElementById('failures').click()")
        texts = on_tracks.run("[...document.getElementById('episodes').options].map(o => o.text)")
        assert all(text.startswith("✗") for text in texts)
        assert len(texts) < 5

    def test_another_level_shows_the_map_of_the_same_episode(self, on_tracks):
        choose_setting(on_tracks, "adrift, level 1, 31 × 31")
        on_tracks.wait_for("view.current.observed")
        on_tracks.run(set_value("episodes", 7))
        shown = "document.getElementById('shown').toDataURL()"
        with_start = on_tracks.run(shown)
        choose_setting(on_tracks, "adrift, level 2, 31 × 31")
        on_tracks.wait_for(f"{shown} !== '{with_start}'")  # without the start
        assert on_tracks.run("document.getElementById('episodes').value") == "7"

    def test_the_path_by_odometry_is_laid_on_the_first_true_pose(self, on_tracks):
        choose_setting(on_tracks, "adrift, level 1, 31 × 31")
        on_tracks.wait_for("view.current.observed")
        assert "odometry" in on_tracks.run("document.getElementById('key').textContent")
        apart = on_tracks.run("view.current.path.x.map((x, index) => Math.abs(x - view.current.observed.x[index]))")
        assert apart[0] == 0
        assert max(apart) > 2  # 32 are a metre

    def test_a_drawn_map_is_shown_as_it_was_given(self, on_tracks):
        choose_setting(on_tracks, "rough, level 1, 31 × 31")
        on_tracks.wait_for("view.current.side === 62")
        greys = on_tracks.run("[...new Set(view.current.shown)]")
        assert len(greys) > 10
        assert not on_tracks.run("differs(view.current)")

    def test_the_rays_are_those_of_the_sensor(self, on_tracks):
        choose_setting(on_tracks, "rebuilt, level 1, 31 × 31")
        on_tracks.wait_for(is_seen("lidar"))
        with_rays = on_tracks.run(PIXELS)
        maze, x, y, yaw, *ranges = on_tracks.run(
            "[view.current.maze, ...['x', 'y', 'yaw'].map(name => view.current.path[name][view.time]),"
            "...rangesOf(view.current.real, view.current.size, view.current.path, view.time, view.current.sensor)]"
        )
        mazes = load_kind_mazes("eval")
        index = [known.name for known in mazes].index(maze)
        pose = np.array([[x / 32, y / 32, yaw * 2 * np.pi / 256]])
        np.testing.assert_allclose(ranges, Lidar(mazes, 3.5).ranges(np.array([index]), pose)[0], atol=1e-4)
        on_tracks.run("document.getElementById('lidar').click()")
        assert on_tracks.run(PIXELS) != with_rays
        choose_setting(on_tracks, "local, 13 × 13")  # without lidar
        on_tracks.wait_for(f"!{is_seen('lidar')} && !{is_seen('group')}")

    def test_it_fits_a_narrow_window(self, on_tracks):
        choose_setting(on_tracks, "adrift, level 1, 31 × 31")
        on_tracks.resize(360, 800)
        on_tracks.wait_for("document.documentElement.clientWidth === 360")
        assert on_tracks.run("document.documentElement.scrollWidth") <= 360


VALUES = "[...document.querySelectorAll('#values tr')].filter(row => row.checkVisibility()).map(row => row.innerText)"
# The contrast of two colours of the style, as WCAG 2 defines it.
CONTRAST = """
    (() => {
      const part = (byte) => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
      const light = (name) => [1, 3, 5].map((at) => part(parseInt(colors()(name).slice(at, at + 2), 16)))
        .reduce((sum, value, index) => sum + value * [0.2126, 0.7152, 0.0722][index], 0.05);
      const [one, other] = [light("%s"), light("%s")];
      return Math.max(one, other) / Math.min(one, other);
    })()"""


class TestTable:
    def test_the_chosen_metric_of_each_setting_and_agent_is_shown_with_its_interval(self, on_tracks):
        rows = on_tracks.run(VALUES)
        assert [row.split("\t")[0] for row in rows] == [
            "setting",
            "local, 13 × 13",
            "rebuilt, level 1, 31 × 31",
            "adrift, level 1, 31 × 31",
            "adrift, level 2, 31 × 31",
            "rough, level 1, 31 × 31",
        ]
        assert re.fullmatch(r"local, 13 × 13(\s+\d\.\d\d \d\.\d\d–\d\.\d\d){2}", rows[1].strip())
        on_tracks.run(set_value("metric", 3))
        assert on_tracks.run(VALUES)[1] != rows[1]
        bars = on_tracks.run("[...document.querySelectorAll('#values i')].filter(bar => bar.checkVisibility()).length")
        assert bars == 10

    def test_distances_and_groups_fold_out(self, on_tracks):
        few = len(on_tracks.run(VALUES))
        on_tracks.run("document.getElementById('finer').click()")
        rows = [row.split("\t")[0] for row in on_tracks.run(VALUES)]
        assert len(rows) > few
        assert {"distance 2", "blocked", "not blocked"} <= set(rows)

    def test_a_phone_keeps_the_settings_in_view(self, on_tracks):
        on_tracks.resize(360, 800)
        on_tracks.wait_for("document.documentElement.clientWidth === 360")
        on_tracks.run(set_value("metric", 0))  # with a column of the paper's
        on_tracks.run("document.querySelector('.scroll').scrollLeft = 200")
        box = "document.querySelector('#values tbody {}').getBoundingClientRect().{}"
        assert on_tracks.run(box.format("td", "left")) < on_tracks.run(box.format("th", "right")) - 20
        assert on_tracks.run(box.format("th", "left")) >= 0
        assert on_tracks.run("document.querySelector('.drawn img').currentSrc") in on_tracks.run(
            "[...document.querySelectorAll('.drawn source')].map(node => node.srcset)"
        )


class TestReading:
    def test_it_opens_on_the_worst_of_the_best_agent(self, on_tracks):
        texts = on_tracks.run("[...document.getElementById('episodes').options].map(o => o.text)")
        order = [("✗ failed", "✓ late", "✓ on time").index(text.split(" · ")[0]) for text in texts]
        assert (order[0], order) == (0, sorted(order))
        assert on_tracks.run("document.getElementById('episodes').selectedIndex") == 0
        assert on_tracks.run("data.results[view.result].label") == "mah"

    def test_what_is_late_is_told_of_all_agents(self, opened):
        opened.wait_for("document.getElementById('others').tBodies[0].rows.length === 3")
        cells = opened.run(
            "[...document.getElementById('others').tBodies[0].rows].map(row => row.innerText.split('\\t'))"
        )
        assert all(re.fullmatch(r"✗ failed|✓ late|✓ on time", outcome.strip()) for _, outcome, *_ in cells)
        for _, _, steps, of_oracle, _ in cells:
            oracle = opened.run("view.current.oracle")
            assert of_oracle.strip() == f"{int(steps) / oracle:.2f} ×"

    @pytest.mark.parametrize("scheme", ["light", "dark"])
    def test_where_map_and_maze_differ_is_seen(self, opened, scheme):
        opened.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        assert opened.run(CONTRAST % ("lost-wall", "wall")) > 3
        assert opened.run(CONTRAST % ("false-wall", "floor")) > 3
        opened.call("Emulation.setEmulatedMedia", features=[])

    def test_the_slider_and_the_arrow_keys_move_through_time(self, opened):
        last = int(opened.run("document.getElementById('time').max"))
        assert last > 20
        assert opened.run("document.getElementById('clock').value").startswith(f"step {last} of {last}, ")
        before = opened.run(PIXELS)
        opened.run(set_value("time", 3, "input"))
        assert opened.run("document.getElementById('clock').value").startswith(f"step 3 of {last}, 0.48 s, ")
        assert opened.run(PIXELS) != before
        opened.run("document.getElementById('time').focus()")
        opened.press("ArrowRight", 39)
        opened.wait_for("document.getElementById('clock').value.startsWith('step 4 of')")

    def test_play_drives_to_the_end(self, opened):
        opened.run(set_value("speed", 16))
        opened.run("document.getElementById('play').click()")
        assert opened.run("document.getElementById('play').textContent") == "Pause"
        opened.wait_for("document.getElementById('play').textContent === 'Play'")
        assert opened.run("document.getElementById('time').value === document.getElementById('time').max")

    def test_failures_only_lists_failures(self, opened):
        choose_setting(opened, "local, 13 × 13")
        opened.wait_for("document.getElementById('count').textContent === '16 of 16 episodes'")
        opened.run("document.getElementById('failures').click()")
        texts = opened.run("[...document.getElementById('episodes').options].map(o => o.text)")
        assert 0 < len(texts) < 16
        assert all(text.startswith("✗") for text in texts)
        assert "did not reach the goal" in opened.run("document.getElementById('outcome').textContent")

    def test_a_flipped_map_and_a_path_that_is_not_recorded_are_named(self, opened):
        choose_setting(opened, "flip 0.2")
        opened.wait_for("document.getElementById('key').textContent.includes('wall on the map only')")
        assert opened.run("document.getElementById('shown').toDataURL()") != opened.run(PIXELS)
        choose_setting(opened, "noise 0.5")
        opened.wait_for("document.getElementById('clock').value === 'no path recorded'")
        assert opened.run("document.getElementById('time').disabled")
        assert opened.run("view.current.shown.some(wall => wall) && view.current.shown.length === 169")

    def test_the_same_episode_of_another_agent_is_one_click_away(self, opened):
        opened.wait_for("document.getElementById('others').tBodies[0].rows.length === 3")
        names = opened.run("[...document.querySelectorAll('#others button')].map(b => b.textContent)")
        assert names == list(MADE_AGENTS)
        opened.run("document.querySelectorAll('#others button')[2].click()")
        opened.wait_for("document.getElementById('outcome').textContent.startsWith('</script>')")

    def test_an_address_can_name_an_episode(self, browser, page):
        browser.open(page, "#episode=1-1")
        browser.wait_for("document.getElementById('episodes').value === '1'")
        assert browser.run("location.hash") == "#episode=1-1"

    def test_every_control_has_a_name_for_screen_readers(self, opened):
        unnamed = opened.run(
            "[...document.querySelectorAll('select, input, button, canvas')].filter(node =>"
            "!(node.labels && node.labels.length) && !node.textContent.trim() && !node.getAttribute('aria-label')"
            ").map(node => node.outerHTML)"
        )
        assert unnamed == []
