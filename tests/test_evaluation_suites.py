"""Suites: what they are made of, the same bytes however they are run, and what is refused."""

from __future__ import annotations

import json
import pathlib

import pytest
from run_folders import IMPORTS, RECORDED, Killed, files_of, kill_after, results_of, summary_of

from mazebench.errors import InputError, Remark, RunError, UnplayableError
from mazebench.evaluation.eval_options import RunOptions
from mazebench.evaluation.suites import SUITES, Part, run_suite
from mazebench.maps.benchmark import SIZES
from mazebench.results.comparison import compare_folders
from mazebench.tasks.task import resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions

TINY = (
    Part("near", TaskOptions(distances=(1, 2)), 1),
    Part("noise-0.5", TaskOptions(distances=(1,), position_noise=0.5), 1),
    Part("warp-0.2", TaskOptions(distances=(3,), map_warp=0.2), 1),
)
PARTS = [part.name for part in TINY]
BOTH = ["planner", "random"]


@pytest.fixture(scope="module", autouse=True)
def _tiny_suite():
    SUITES["tiny"] = TINY
    yield
    del SUITES["tiny"]


@pytest.fixture(scope="module")
def tiny_run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    run_suite("tiny", BOTH, folder)
    return folder


class TestParts:
    @pytest.mark.parametrize("suite", ["paper", "quick"])
    def test_no_part_is_run_twice(self, suite):
        parts = SUITES[suite]
        assert len({part.name for part in parts}) == len(parts)
        tasks = {(resolve_for_evaluation(part.task), part.episodes_per_distance) for part in parts}
        assert len(tasks) == len(parts)

    def test_the_suite_paper_is_the_papers_protocol(self):
        paper = {part.name: resolve_for_evaluation(part.task) for part in SUITES["paper"]}
        assert list(paper) == [
            *(f"local-{size}" for size in SIZES),
            *(f"hierarchical-13-k{cells}" for cells in range(1, 6)),
            *("flip-0.05", "flip-0.1", "flip-0.2", "flip-0.3", "warp-0.05", "warp-0.1", "warp-0.2"),
            *(f"noise-{level}" for level in ("0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0")),
        ]
        assert paper["local-13"].distances == tuple(range(1, 16))
        assert paper["local-21"].size == 21
        corners, flipped = paper["hierarchical-13-k2"], paper["flip-0.3"]
        assert (corners.options.task, corners.options.landmark_distance) == ("hierarchical", 2)
        assert (flipped.options.task, flipped.options.map_flip) == ("hierarchical", 0.3)
        assert (paper["warp-0.1"].distances, paper["warp-0.1"].options.map_warp) == ((2, 4, 6, 8, 10), 0.1)
        assert (paper["noise-1.0"].distances, paper["noise-1.0"].options.position_noise) == ((2, 4, 6, 8, 10), 1.0)

    @pytest.mark.parametrize("split", ["", "-dev"])
    def test_tracks_by_camera_alone_are_the_tracks_with_pictures_in_place_of_the_lidar(self, split):
        for part, by_camera in zip(SUITES[f"tracks{split}"], SUITES[f"tracks-camera{split}"], strict=True):
            task = resolve_for_evaluation(by_camera.task)
            assert (task.options.sensors, task.options.look, task.options.camera[:2]) == (
                ("egocentric",),
                "varied",
                (64, 75),
            )
            assert task.options.look_split == (split.removeprefix("-") or "eval")
            assert (by_camera.name, task.replace(sensors=(), look="plain")) == (
                part.name,
                resolve_for_evaluation(part.task),
            )


class TestRun:
    def test_the_folder_tells_what_is_in_it(self, tiny_run):
        content = json.loads((tiny_run / "suite.json").read_text())
        expected = {"suite": "tiny", "parts": PARTS, "agents": BOTH, "benchmark": "paper", "seed": 0}
        assert (expected | {"folders": dict(zip(BOTH, BOTH, strict=True))}).items() <= content.items()
        assert len(content["benchmark_manifest_sha256"]) == 64
        for agent in BOTH:
            for part in PARTS:
                assert {path.name for path in (tiny_run / agent / part).iterdir()} == RECORDED
                expected = {"agent": agent, "suite": "tiny", "part": part}
                assert expected.items() <= summary_of(tiny_run / agent / part).items()

    def test_the_bytes_do_not_depend_on_how_it_is_run(self, tiny_run, tmp_path):
        calls = []
        summaries = run_suite("tiny", BOTH, tmp_path, RunOptions(num_envs=16), lambda *call: calls.append(call))
        assert results_of(tmp_path) == results_of(tiny_run)
        assert (calls[0], calls[-1]) == ((0, 160), (160, 160))
        assert calls == sorted(calls)
        assert [(summary.agent, summary.part) for summary in summaries] == [
            (agent, part) for agent in BOTH for part in PARTS
        ]


class TestResume:
    def test_a_suite_goes_on_wherever_it_was_killed(self, tiny_run, tmp_path):
        with pytest.raises(Killed):
            run_suite("tiny", BOTH, tmp_path, RunOptions(num_envs=16), kill_after(70))
        finished = {path: path.read_bytes() for path in tmp_path.rglob("summary.json")}
        run_suite("tiny", BOTH, tmp_path, RunOptions(resume=True))
        assert results_of(tmp_path) == results_of(tiny_run)
        assert {path: path.read_bytes() for path in finished} == finished

    def test_an_agent_can_be_added(self, tiny_run, tmp_path):
        run_suite("tiny", ["planner"], tmp_path)
        before = files_of(tmp_path / "planner")
        run_suite("tiny", ["random"], tmp_path, RunOptions(resume=True))
        assert results_of(tmp_path) == results_of(tiny_run)
        assert files_of(tmp_path / "planner") == before

    def test_an_agent_that_fails_costs_the_others_nothing(self, tiny_run, tmp_path, monkeypatch):
        code = "class Failing(SingleAgent):\n    def act(self, observation):\n        raise RuntimeError('no')\n"
        (tmp_path / "failing_at_hand.py").write_text(IMPORTS + code)
        monkeypatch.syspath_prepend(tmp_path)
        out = tmp_path / "out"
        with pytest.raises(RunError, match=r"agent 'failing_at_hand:Failing': act\(\) raised RuntimeError: no"):
            run_suite("tiny", ["random", "failing_at_hand:Failing"], out)
        run_suite("tiny", ["planner"], out, RunOptions(resume=True))
        for agent in BOTH:
            assert results_of(out / agent) == results_of(tiny_run / agent)


PARTIAL = """
class Partial(SingleAgent):
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if interface.task == "hierarchical" or interface.size > LARGEST:
            raise UnplayableError(f"agent 'Partial': plays local goals only, found {interface.task}")
        return cls()

    def act(self, observation):
        return 0
"""


class TestPartsThatCannotBePlayed:
    @pytest.fixture
    def mixed(self, monkeypatch):
        parts = (
            *TINY[:2],
            Part("corners", TaskOptions(task="hierarchical", time_limit=5)),
            Part("flips", TaskOptions(task="hierarchical", map_flip=0.1, time_limit=5)),
        )
        monkeypatch.setitem(SUITES, "mixed", parts)

    def write_agent(self, tmp_path, monkeypatch, largest):
        code = f"{IMPORTS}from mazebench import UnplayableError\nLARGEST = {largest}\n{PARTIAL}"
        (tmp_path / f"partial_{largest}.py").write_text(code)
        monkeypatch.syspath_prepend(tmp_path)
        return f"partial_{largest}:Partial"

    def test_they_are_left_out_and_named(self, mixed, tmp_path, monkeypatch):
        agent = self.write_agent(tmp_path, monkeypatch, 13)
        with pytest.warns(Remark) as warned:
            summaries = run_suite("mixed", [agent, "random"], tmp_path / "out")
        assert [str(each.message) for each in warned] == [
            "agent 'Partial': plays local goals only, found hierarchical; left out: corners, flips"
        ]
        played = [(summary.agent, summary.part) for summary in summaries]
        assert played[:2] == [(agent, "near"), (agent, "noise-0.5")]
        assert len(played) == 6
        folder = agent.replace(":", "-")
        assert sorted(path.name for path in (tmp_path / "out" / folder).iterdir()) == ["near", "noise-0.5"]
        found = compare_folders(tmp_path / "out" / folder, tmp_path / "out" / "random")
        assert list(found.parts) == ["near", "noise-0.5"]

    def test_an_agent_that_can_play_none_is_refused(self, mixed, tmp_path, monkeypatch):
        with pytest.raises(UnplayableError, match="it can play no part of the suite 'mixed'"):
            run_suite("mixed", ["random", self.write_agent(tmp_path, monkeypatch, 3)], tmp_path / "out")
        assert not (tmp_path / "out").exists()


class TestRefused:
    @pytest.mark.parametrize(
        ("agents", "options", "said"),
        [
            (["nobody"], {}, "unknown agent 'nobody'"),
            (["mah", "dqn"], {"checkpoint": "x"}, "expected one agent with --checkpoint or --set, found 2"),
            (["random"], {"checkpoint": "x"}, "agent 'random' reads no checkpoint"),
        ],
    )
    def test_a_suite_that_cannot_be_run_is_refused_and_nothing_is_written(self, tmp_path, agents, options, said):
        with pytest.raises(InputError, match=said):
            run_suite("tiny", agents, tmp_path / "out", **options)
        assert list(tmp_path.iterdir()) == []

    def test_a_folder_that_holds_another_run_is_refused(self, tiny_run):
        before = files_of(tiny_run)
        for suite, options, said in [
            ("tiny", {"run": RunOptions()}, "holds a run already; go on with --resume or name another folder"),
            ("tiny", {"run": RunOptions(resume=True), "seed": 1}, "holds another run: its seed is 0, this one's 1"),
            ("quick", {"run": RunOptions(resume=True)}, "holds another run: its suite is tiny, this one's quick"),
        ]:
            with pytest.raises(InputError, match=said):
                run_suite(suite, ["random"], tiny_run, **options)
        assert files_of(tiny_run) == before

    @pytest.mark.parametrize(
        ("content", "said"),
        [
            (None, r"expected an empty folder or a suite's, found 'thesis\.tex' in it"),
            ({"benchmark": "v0"}, "holds another run: its benchmark is v0, this one's paper"),
        ],
    )
    def test_a_folder_that_holds_something_else_is_refused(self, tiny_run, tmp_path, content, said):
        if isinstance(content, dict):
            content = json.dumps(json.loads((tiny_run / "suite.json").read_text()) | content)
        (tmp_path / ("thesis.tex" if content is None else "suite.json")).write_text(content or "")
        before = files_of(tmp_path)
        with pytest.raises(InputError, match=said) as refused:
            run_suite("tiny", ["random"], tmp_path, RunOptions(resume=True))
        assert "\n" not in str(refused.value)
        assert files_of(tmp_path) == before


class TestComparison:
    def test_folders_without_results_are_refused(self, tiny_run, tmp_path):
        agent = tiny_run / "random"
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "thesis.tex").touch()
        for folder, said in [
            (tmp_path / "none", "expected a finished evaluation, found nothing there"),
            (tmp_path / "other", r"expected a finished evaluation, found 'thesis\.tex' in it"),
        ]:
            with pytest.raises(InputError, match=said):
                compare_folders(agent, folder)
