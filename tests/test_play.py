"""`mazebench play`: what keys do, what is recorded, who may connect, and what a person sees in headless Chromium."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import queue
import re
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from faults import nothing_left as nothing_left
from faults import start
from run_folders import records_of, summary_of
from simple_mazes import corridor, field

from mazebench.agent import Inputs
from mazebench.evaluation.eval_options import EvalOptions, RunOptions
from mazebench.evaluation.evaluate import evaluate, run_evaluation
from mazebench.evaluation.plan import make_plan
from mazebench.evaluation.suites import SUITES
from mazebench.maps.maze import Maze
from mazebench.play.person import Person, keys_of
from mazebench.results.comparison import compare_folders
from mazebench.results.reading import load_result
from mazebench.tasks.task_options import TaskOptions
from mazebench.world.bodies import BODIES, SLIDER

aiohttp = pytest.importorskip("aiohttp")
from mazebench.play.page import Page  # noqa: E402
from mazebench.play.session import DRIVING, Session  # noqa: E402

NAME = "Ann <b>&"
SEES = {"sensors": ("egocentric",), "camera_size": 32}
Policy = Callable[[dict[str, Any]], Sequence[str] | None]  # the keys of a view; None to go away


@contextlib.contextmanager
def evaluating(out, maze: Maze, *, real_time=False, resume=False, episodes=1, **task) -> Iterator[str]:
    """Yields the address of a page on which the episodes of an evaluation wait to be driven in a thread."""
    asked = TaskOptions(mazes=(maze,), **({} if "sensors" in task else SEES) | task)
    options = EvalOptions(agent="person", task=asked, episodes_per_distance=episodes, overrides={"name": NAME})
    addresses: queue.Queue[str] = queue.Queue()

    def run() -> None:
        with Page() as page, Session(page, NAME, real_time) as session:

            def advance(ended: int, of: int) -> None:
                session.num_ended, session.num_episodes = ended, of

            addresses.put(page.address)
            run_evaluation(options, out, RunOptions(record=True, resume=resume), advance, pool=session)
            page.show({"phase": "over", "words": "all have ended"})

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    yield addresses.get(timeout=60)
    thread.join(60)
    assert not thread.is_alive()


async def drive(address: str, policy: Policy) -> list[dict[str, Any]]:
    """Answers each view by the keys of a policy until there is none, and returns the views."""
    views = []
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{address}socket") as page:
        async for message in page:
            views.append(json.loads(message.data))
            if (keys := None if views[-1]["phase"] in ("over", "elsewhere") else policy(views[-1])) is None:
                break
            await page.send_json({"number": views[-1]["number"], "keys": list(keys)})
    return views


def to_goal(view: dict[str, Any]) -> list[str]:
    """Turns to the goal and drives, where nothing stands in the way; after the end, goes on."""
    if view["phase"] == "end":
        return ["next"]
    (x, y, yaw), (row, column) = view["trail"][-1], divmod(view["goal"], view["side"])
    angle = math.remainder(math.atan2(y - row - 0.5, column + 0.5 - x) - yaw, 2 * math.pi)
    return ["forward"] if abs(angle) < 0.3 else ["look_left" if angle > 0 else "look_right"]


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """The folder of two episodes that were driven to the goal, and the views."""
    out = tmp_path_factory.mktemp("driven") / "ann"
    with evaluating(out, field(7), episodes=2, distances=(2,)) as address:
        views = asyncio.run(drive(address, to_goal))
    return out, views


class TestEvaluation:
    def test_a_person_is_evaluated_as_agents_are(self, driven, tmp_path):
        out, _ = driven
        assert {path.name for path in out.iterdir()} == {
            *("config.json", "episodes.jsonl", "summary.json", "trajectories.npz")
        }
        assert [record["success"] for record in records_of(out)] == [True, True]
        assert summary_of(out)["config"] == {"name": NAME}
        assert load_result(out).summary.row == f"person name={NAME} with egocentric (size 32)"
        evaluate("random", out=tmp_path / "random", mazes=(field(7),), distances=(2,), episodes_per_distance=2)
        both = compare_folders(out, tmp_path / "random").parts[""].overall
        assert both.num_episodes == 2
        assert both.metrics["success_rate"].a == 1

    def test_views_say_where_one_is_and_how_much_time_is_left(self, driven):
        first, second = driven[1][:2]
        assert (first["phase"], first["number_of"], first["name"]) == ("drive", [1, 2], NAME)
        assert (first["seconds"], second["seconds"]) == (0, 0.16)
        assert first["limit"] == pytest.approx(0.16 * 100)
        row, column = divmod(first["start"], first["side"])
        assert first["trail"][0][:2] == [column + 0.5, row + 0.5]
        assert first["camera"].startswith("data:image/jpeg;base64,")

    def test_the_end_shows_the_verdict_and_both_ways(self, driven):
        out, views = driven
        ends = [view for view in views if view["phase"] == "end"]
        for number, (end, record) in enumerate(zip(ends, records_of(out), strict=True), 1):
            in_time = record["steps"] <= 1.25 * record["oracle_steps"]
            assert end["verdict"] == ("On time" if in_time else "Late")
            assert f"after {0.16 * record['steps']:.1f} s; the oracle" in end["words"]
            assert f"needs {0.16 * record['oracle_steps']:.1f} s" in end["words"]
            assert end["number_of"] == [number, 2]
            assert [len(way) - 1 for way in end["ways"]] == [record["oracle_steps"], record["steps"]]
            assert end["changed"] == []
        assert views[-1]["phase"] == "over"

    def test_what_the_map_had_wrong_is_shown_at_the_end_only(self, tmp_path):
        old = field(7).walls.copy()
        old[3, 2:5] = True
        task = {"shown": (Maze(old, "old"),), "distances": (2,), "time_limit": 1}
        with evaluating(tmp_path / "run", field(7), **task) as address:
            views = asyncio.run(drive(address, lambda view: ["next"] if view["phase"] == "end" else ["backward"]))
        assert views[1]["changed"] == [[3, column, False] for column in (2, 3, 4)]
        assert views[1]["verdict"] == "Out of time"
        assert not {"changed", "building", "ways"} & views[0].keys()

    def test_a_run_that_is_stopped_goes_on_at_the_same_step(self, tmp_path, nothing_left):
        words = ("--task", "local", "--distances", "2", "--size", "13", "--camera-size", "32")
        errors = []
        for resume in ((), ("--resume",)):
            process = start("play", *words, "--name", NAME, "--out", tmp_path / "run", *resume)
            address = re.search(r"http://127\.0\.0\.1:\d+/\S+/", process.stdout.readline())[0]
            last = 20 if resume else 3
            views = asyncio.run(
                drive(address, lambda view, last=last: ["look_left"] if view["number"] < last else None)
            )
            process.send_signal(signal.SIGINT)
            errors.append(process.communicate(timeout=60)[1].splitlines()[-1])
            assert process.returncode == 130
            assert views[0]["seconds"] == (pytest.approx(0.32) if resume else 0)
            assert len(views[0]["trail"]) == (3 if resume else 1)
        assert errors[0].startswith(
            f"mazebench: interrupted; 0 of 20 episodes are kept in {tmp_path / 'run'}; go on with"
        )
        assert errors[0].endswith("--resume")
        steps = [json.loads(line) for line in (tmp_path / "run" / DRIVING).read_text().split()]
        assert steps[:2] == [{"episode": 0, "keys": ["look_left"]}] * 2

    def test_time_runs_without_keys_in_real_time_once_a_page_is_open(self, tmp_path):
        task = {"actions": "velocity", "distances": (2,), "time_limit": 3}
        with evaluating(tmp_path / "run", field(7), real_time=True, **task) as address:
            views = asyncio.run(drive(address, lambda view: ["next"] if view["phase"] == "end" else []))
        assert [view["phase"] for view in views] == ["drive"] * 3 + ["end", "over"]
        assert records_of(tmp_path / "run")[0]["path_length"] == pytest.approx(0, abs=1e-3)

    def test_the_suite_has_twelve_episodes_of_dev_in_mazes_of_their_own(self):
        plans = [
            make_plan(EvalOptions(agent="random", task=part.task, episodes_per_maze=part.episodes_per_maze))
            for part in SUITES["people-dev"]
        ]
        assert [len(plan.trials) for plan in plans] == [4, 4, 4]
        assert {plan.task.options.split for plan in plans} == {"dev"}
        assert len({trial.episode.maze for plan in plans for trial in plan.trials}) == 12


@pytest.mark.parametrize(
    ("kind", "keys", "action"),
    [
        ("six", ["strafe_right"], 3),
        ("six", ["forward", "look_left"], 4),
        ("four", ["look_right"], 3),
        ("velocity", ["forward", "look_left"], [1, 0, 1]),
        ("velocity", ["strafe_right", "backward"], [-1, -1, 0]),
        ("velocity", ["forward", "backward"], [0, 0, 0]),
        ("velocity", [], [0, 0, 0]),
        ("diff", ["forward", "look_right"], [1, -1]),
    ],
)
def test_keys_become_an_action(kind, keys, action):
    actions, _ = Person(lambda _: keys, kind).act(Inputs({}, *np.zeros((3, 1))), None)
    assert actions.tolist() == [action]


def test_keys_that_would_not_move_the_body_are_not_offered():
    offered = [len(keys_of(kind, SLIDER)) for kind in ("six", "velocity", "four", "diff")]
    assert offered == [6, 6, 4, 4]
    assert len(keys_of("six", BODIES["turtlebot3"])) == 4


class TestServer:
    @pytest.fixture
    def address(self, tmp_path) -> Iterator[str]:
        with evaluating(tmp_path / "run", field(7), distances=(2,)) as address:
            yield address
            asyncio.run(drive(address, to_goal))

    def test_only_this_machine_with_the_token_is_let_in(self, address):
        root, token = re.fullmatch(r"(http://127\.0\.0\.1:\d+/)(\S+)/", address).groups()
        host = root.removeprefix("http://")[:-1]

        async def statuses() -> list[int]:
            found = []
            async with aiohttp.ClientSession() as session:
                for path, headers in (
                    (f"{token}/", {}),
                    (f"{token}/page.js", {"Host": host.replace("127.0.0.1", "localhost")}),
                    (f"{token}/socket", {"Origin": root[:-1]}),  # no upgrade is asked for
                    ("", {}),
                    ("page.js", {}),
                    (f"{token[:-1]}x/", {}),
                    (f"{token[:-1]}/socket", {}),
                    (f"{token}/", {"Host": "evil.example"}),
                    (f"{token}/socket", {"Origin": "http://evil.example"}),
                    (f"{token}/socket", {"Origin": "null"}),
                ):
                    async with session.get(root + path, headers=headers) as response:
                        found.append(response.status)
            return found

        assert asyncio.run(statuses()) == [200, 200, 400, *[403] * 7]

    def test_the_page_loads_nothing_from_elsewhere(self, address):
        async def page() -> str:
            async with aiohttp.ClientSession() as session, session.get(address) as response:
                return await response.text()

        text = asyncio.run(page())
        assert "//" not in text
        assert "default-src 'none'; connect-src 'self'; img-src data:; script-src 'self'; style-src 'self'" in text

    def test_messages_that_mean_nothing_are_passed_over(self, address):
        async def try_all() -> dict[str, Any]:
            async with aiohttp.ClientSession() as session, session.ws_connect(f"{address}socket") as page:
                number = (await page.receive_json())["number"]
                for text in (
                    *("", "forward", "[]", '{"number": 1}', '{"number": "1", "keys": []}', "{" * 2000),
                    json.dumps({"number": number, "keys": ["jump"]}),
                    json.dumps({"number": number, "keys": ["next"]}),
                    json.dumps({"number": number - 1, "keys": ["forward"]}),
                    json.dumps({"number": number, "keys": ["look_left"]}),
                ):
                    await page.send_str(text)
                return await page.receive_json()

        view = asyncio.run(try_all())
        assert view["seconds"] == 0.16
        assert view["trail"][0][:2] == view["trail"][1][:2]
        assert view["trail"][0][2] != view["trail"][1][2]

    def test_the_page_that_was_opened_last_drives(self, address):
        async def open_two() -> tuple[dict[str, Any], dict[str, Any]]:
            async with aiohttp.ClientSession() as session, session.ws_connect(f"{address}socket") as first:
                number = (await first.receive_json())["number"]
                async with session.ws_connect(f"{address}socket") as second:
                    await second.receive_json()
                    told = await first.receive_json()
                    await first.send_json({"number": number, "keys": ["forward"]})
                    await second.send_json({"number": number, "keys": ["look_left"]})
                    return told, await second.receive_json()

        told, view = asyncio.run(open_two())
        assert told == {"phase": "elsewhere"}
        assert view["seconds"] == 0.16
        assert view["trail"][0][:2] == view["trail"][1][:2]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("play --resume", "--resume needs --out"),
        ("play --task hierarchical", "expected --task local or a track, found hierarchical"),
        ("play --suite people", "unknown suite 'people'"),
        ("play --suite people-dev --track rebuilt", "evaluations of its own; found --task"),
        ("play --name a\tb", "expected a name of at most 60 printable characters, found 'a\\tb'"),
        ("play --view lidar --camera-size 99", "expected the sensor egocentric or depth or labels, found lidar"),
        ("play --real-time --actions six", "expected --actions velocity in real time, found six"),
        ("play --workers 2", "No such option: --workers"),
        ("play --cluster ray", "No such option: --cluster"),
        ("play --shard 1/2", "No such option: --shard"),
        ("eval --agent person", "agent 'person': expected the command `mazebench play`, found another one"),
        ("eval --agent person --workers 2", "agent 'person': expected no --workers with this config, found 2"),
        ("eval --agent person --cluster ray", "agent 'person': expected one machine, found a cluster"),
        ("eval --agent person --shard 1/2 --out run", "agent 'person': expected one machine, found a cluster"),
    ],
)  # fmt: skip
def test_bad_input_gets_one_line(command, words, said):
    status, _, errors = command(*words.split(" "))
    assert status == 2
    assert said in errors.splitlines()[-1]


def test_a_port_that_is_taken_and_a_missing_package_get_one_line(command, monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        status, _, errors = command("play", "--port", port, "--track", "rebuilt")
        assert (status, errors.splitlines()[-1]) == (
            2,
            f"mazebench: expected --port that is free, found {port}: Address already in use",
        )
    for name in [each for each in sys.modules if each.startswith("mazebench.play")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    status, _, errors = command("play", "--track", "rebuilt")
    assert status == 2
    assert "mazebench play needs aiohttp, which the extra [play] brings" in errors


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed")
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


UP, LEFT, RIGHT = ("ArrowUp", 38), ("KeyA", 65), ("KeyD", 68)
TEXT = "document.getElementById('{}').textContent"
IS_SHOWN = "document.getElementById('{}').offsetParent !== null"


def turn_until(browser: Browser, key: tuple[str, int], condition: str) -> None:
    browser.hold(*key, True)
    browser.wait_for(condition)
    browser.hold(*key, False)


class TestPage:
    def test_keys_drive_to_a_wall_and_to_the_end_of_the_episode(self, browser, tmp_path):
        browser.errors.clear()
        task = {"start": "1,4", "goal": "1,7", "time_limit": 60}
        with evaluating(tmp_path / "run", corridor(), **task) as address:
            browser.open(address)
            browser.wait_for(TEXT.format("count") + " === 'episode 1 of 1'")
            assert browser.run(TEXT.format("name")) == NAME
            assert browser.run(TEXT.format("left")) == "9.6 s"
            turned = "view.trail.at(-1)[2] - {0}"
            yaw = f"Math.abs(Math.atan2(Math.sin({turned}), Math.cos({turned}))) < 0.25"
            turn_until(browser, LEFT, yaw.format("Math.PI"))
            browser.hold(*UP, True)
            browser.wait_for("view.trail.at(-1)[0] < 1.2")  # the wall ends 1 m from the left
            browser.wait_for("view.trail.length > 5 && view.trail.at(-1)[0] === view.trail.at(-2)[0]")
            browser.hold(*UP, False)
            browser.wait_for("!held.length")
            assert browser.run("view.trail.at(-1)[0]") == pytest.approx(1.15, abs=0.03)

            # A page that is loaded again goes on where it was, without a key that is down.
            browser.open(address)
            browser.wait_for(TEXT.format("count") + " === 'episode 1 of 1'")
            num_steps = len((tmp_path / "run" / DRIVING).read_text().split())
            assert browser.run(TEXT.format("used")) == f"{0.16 * num_steps:.1f} s"
            turn_until(browser, RIGHT, yaw.format("0"))
            turn_until(browser, UP, IS_SHOWN.format("end"))
            assert browser.run(TEXT.format("verdict")) in ("On time", "Late")
            assert browser.run(IS_SHOWN.format("view")) is True
            browser.run("document.getElementById('next').click()")
            browser.wait_for(TEXT.format("said") + " === 'all have ended'")
        assert browser.errors == []
        (record,) = records_of(tmp_path / "run")
        assert record["success"] is True

    def test_of_two_tabs_the_last_one_drives_and_the_other_says_so(self, browser, tmp_path):
        browser.errors.clear()
        with evaluating(tmp_path / "run", field(7), distances=(2,), sensors=("lidar",)) as address:
            browser.open(address)
            browser.wait_for(IS_SHOWN.format("view"))
            with Browser(tmp_path / "profile") as other:
                other.open(address)
                browser.wait_for(IS_SHOWN.format("again"))
                assert browser.run(TEXT.format("said")) == "You drive in another tab or window now."
                other.wait_for("view.phase === 'drive'")
                browser.press(*LEFT)
                assert other.run("view.seconds") == 0
                other.press(*LEFT)
                other.wait_for("view.seconds > 0")
                browser.run("document.getElementById('again').click()")
                other.wait_for(IS_SHOWN.format("again"))
                assert other.errors == []
            browser.wait_for("view.seconds > 0 && view.phase === 'drive'")
            asyncio.run(drive(address, to_goal))
        assert browser.errors == []

    def test_fingers_drive_on_a_phone(self, browser, tmp_path):
        with evaluating(tmp_path / "run", field(7), distances=(2,)) as address:
            browser.call("Emulation.setTouchEmulationEnabled", enabled=True)
            browser.resize(390, 844)
            browser.open(address)
            browser.wait_for(IS_SHOWN.format("pad"))
            box = "document.querySelector('[data-key=look_left]').getBoundingClientRect()"
            point = {name: browser.run(f"{box}.{name}") + 9 for name in ("x", "y")}
            assert point["y"] < 844
            assert browser.run("document.documentElement.scrollWidth") == 390
            browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[point])
            browser.wait_for("view.seconds >= 0.32")
            browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
            browser.wait_for("!held.length")
            browser.call("Emulation.setTouchEmulationEnabled", enabled=False)
            browser.resize(1200, 900)
            asyncio.run(drive(address, to_goal))
        assert browser.errors == []
