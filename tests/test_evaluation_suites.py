"""Suites: what they are made of, the same bytes however they are run, going on after a kill, and what is refused."""

from __future__ import annotations

import json
import pathlib
import shutil

import pytest

from mazebench.errors import InputError, RunError
from mazebench.evaluation.comparison import compare_folders
from mazebench.evaluation.harness import EvalOptions
from mazebench.evaluation.suites import SUITES, Part, SuiteRun, folder_name
from mazebench.evaluation.trajectories import TRAJECTORIES, load_trajectories
from mazebench.maps.benchmark import SIZES

TINY = (
    Part("near", {"distances": (1, 2), "episodes_per_distance": 1}),
    Part("noise-0.5", {"distances": (1,), "position_noise": 0.5, "episodes_per_distance": 1}),
    Part("corners", {"task": "hierarchical"}),
)
FILES = {"config.json", "episodes.jsonl", "summary.json", TRAJECTORIES}


@pytest.fixture(scope="module", autouse=True)
def _tiny_suite():
    SUITES["tiny"] = TINY
    yield
    del SUITES["tiny"]


@pytest.fixture(scope="module")
def tiny_run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    SuiteRun("tiny", ["planner", "random"], folder).run()
    return folder


def results_of(folder: pathlib.Path) -> dict[str, bytes]:
    """The files of a run that are the same however it was run."""
    names = ("episodes.jsonl", TRAJECTORIES, "config.json")
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.name in names
    }


def all_of(folder: pathlib.Path) -> dict[pathlib.Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class TestParts:
    @pytest.mark.parametrize("suite", ["paper", "quick"])
    def test_parts_when_listed(self, suite):
        parts = SUITES[suite]
        assert len({part.name for part in parts}) == len(parts)
        options = [EvalOptions("random", **part.changes) for part in parts]  # all fields exist
        assert len({repr(option) for option in options}) == len(parts), "none is run twice"

    def test_paper_when_compared_with_the_protocol(self):
        paper = {part.name: EvalOptions("random", **part.changes) for part in SUITES["paper"]}
        assert list(paper) == [
            *(f"local-{size}" for size in SIZES),
            *(f"hierarchical-13-k{cells}" for cells in range(1, 6)),
            *("flip-0.05", "flip-0.1", "flip-0.2", "flip-0.3", "warp-0.05", "warp-0.1", "warp-0.2"),
            *(f"noise-{level}" for level in ("0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0")),
        ]
        assert paper["local-13"].distances == tuple(range(1, 16))
        assert paper["local-21"].size == 21
        assert (paper["hierarchical-13-k2"].task, paper["hierarchical-13-k2"].landmark_distance) == ("hierarchical", 2)
        assert (paper["flip-0.3"].task, paper["flip-0.3"].map_flip) == ("hierarchical", 0.3)
        assert (paper["warp-0.1"].distances, paper["warp-0.1"].map_warp) == ((2, 4, 6, 8, 10), 0.1)
        assert (paper["noise-1.0"].distances, paper["noise-1.0"].position_noise) == ((2, 4, 6, 8, 10), 1.0)

    def test_quick_when_counted(self, tmp_path):
        run = SuiteRun("quick", ["random"], tmp_path)
        assert sum(len(evaluation.trials) for evaluation in run.evaluations) == 420
        assert list(tmp_path.iterdir()) == []  # nothing is written until it runs


class TestRun:
    def test_folder_when_it_ran(self, tiny_run):
        content = json.loads((tiny_run / "suite.json").read_text())
        assert content["suite"] == "tiny"
        assert content["parts"] == ["near", "noise-0.5", "corners"]
        assert content["agents"] == ["planner", "random"]
        assert content["folders"] == {"planner": "planner", "random": "random"}
        assert (content["benchmark"], content["seed"], len(content["benchmark_manifest_sha256"])) == ("v1", 0, 64)
        for agent in ("planner", "random"):
            assert {path.name for path in (tiny_run / agent).iterdir()} == {"near", "noise-0.5", "corners"}
            for part in content["parts"]:
                assert {path.name for path in (tiny_run / agent / part).iterdir()} == FILES
                summary = json.loads((tiny_run / agent / part / "summary.json").read_text())
                assert (summary["agent"], summary["suite"], summary["part"]) == (agent, "tiny", part)
                assert len(load_trajectories(tiny_run / agent / part / TRAJECTORIES, summary["episodes"])) > 0

    @pytest.mark.parametrize("running", [{"num_envs": 7}, {"workers": 2, "num_envs": 16}], ids=["envs", "workers"])
    def test_bytes_when_run_otherwise(self, tiny_run, tmp_path, running):
        calls = []
        run = SuiteRun("tiny", ["planner", "random"], tmp_path)
        run.run(progress=lambda done, of: calls.append((done, of)), **running)
        assert results_of(tmp_path) == results_of(tiny_run)
        assert (calls[0], calls[-1]) == ((0, 160), (160, 160))
        assert calls == sorted(calls)
        assert [summary["part"] for summary in run.summaries()] == ["near", "noise-0.5", "corners"] * 2

    def test_files_when_nothing_is_recorded(self, tiny_run, tmp_path):
        SuiteRun("tiny", ["random"], tmp_path, record=False).run()
        assert not list(tmp_path.rglob(TRAJECTORIES))
        assert (tmp_path / "random/near/episodes.jsonl").read_bytes() == (
            tiny_run / "random/near/episodes.jsonl"
        ).read_bytes()


class TestResume:
    def test_run_when_killed_between_and_within_parts(self, tiny_run, tmp_path):
        out = tmp_path / "out"
        shutil.copytree(tiny_run, out)
        shutil.rmtree(out / "planner" / "corners")  # not begun
        (out / "planner" / "noise-0.5" / "summary.json").unlink()  # half done
        (out / "planner" / "noise-0.5" / TRAJECTORIES).unlink()
        records = out / "planner" / "noise-0.5" / "episodes.jsonl"
        records.write_bytes(records.read_bytes()[:1500])
        finished = all_of(out / "random")
        calls = []
        SuiteRun("tiny", ["planner", "random"], out).run(
            resume=True, progress=lambda done, of: calls.append((done, of))
        )
        assert results_of(out) == results_of(tiny_run)
        assert all_of(out / "random") == finished
        assert calls[0] == (120, 160)  # what was recorded without its trajectory is run again

    def test_run_when_an_agent_is_added(self, tiny_run, tmp_path):
        SuiteRun("tiny", ["planner"], tmp_path).run()
        before = all_of(tmp_path / "planner")
        SuiteRun("tiny", ["random"], tmp_path).run(resume=True)
        assert results_of(tmp_path) == results_of(tiny_run)
        assert all_of(tmp_path / "planner") == before
        assert json.loads((tmp_path / "suite.json").read_text())["agents"] == ["planner", "random"]

    def test_run_when_finished(self, tiny_run):
        before = all_of(tiny_run)
        run = SuiteRun("tiny", ["planner", "random"], tiny_run)
        assert run.is_finished
        run.run(resume=True)
        assert all_of(tiny_run) == before

    def test_parts_when_an_agent_fails(self, tiny_run, tmp_path, monkeypatch):
        (tmp_path / "failing_at_hand.py").write_text(
            "class Failing:\n"
            "    @classmethod\n"
            "    def build(cls, interface, *, seed=0, checkpoint=None):\n"
            "        return cls()\n"
            "    initial_state = build\n"
            "    def act(self, observation, is_first, state, explore=False):\n"
            "        raise RuntimeError('no')\n"
        )
        monkeypatch.syspath_prepend(tmp_path)
        out = tmp_path / "out"
        with pytest.raises(RunError, match=r"agent 'failing_at_hand:Failing': act\(\) raised RuntimeError: no"):
            SuiteRun("tiny", ["random", "failing_at_hand:Failing"], out).run()
        assert results_of(out / "random") == results_of(tiny_run / "random")
        SuiteRun("tiny", ["planner"], out).run(resume=True)
        assert results_of(out / "planner") == results_of(tiny_run / "planner")


class TestRefused:
    def test_suite_when_it_cannot_be(self, tmp_path):
        for suite, agents, options, said in [
            ("papr", ["random"], {}, "unknown suite 'papr'; available: paper, quick, tiny"),
            ("tiny", ["nobody"], {}, "unknown agent 'nobody'"),
            ("tiny", ["random", "random"], {}, "found two for 'random'"),
            ("tiny", ["mah", "dqn"], {"checkpoint": "x"}, "expected one agent with --checkpoint, found 2"),
            ("tiny", ["random"], {"checkpoint": "x"}, "agent 'random' reads no checkpoint"),
        ]:
            with pytest.raises(InputError, match=said):
                SuiteRun(suite, agents, tmp_path / "out", **options).run()
        assert list(tmp_path.iterdir()) == []

    def test_run_when_folder_holds_another(self, tiny_run):
        before = all_of(tiny_run)
        with pytest.raises(InputError, match="holds a run already; go on with --resume or name another folder"):
            SuiteRun("tiny", ["random"], tiny_run).run()
        with pytest.raises(InputError, match="holds another run: its seed is 0, this one's 1"):
            SuiteRun("tiny", ["random"], tiny_run, seed=1).run(resume=True)
        with pytest.raises(InputError, match="holds another run: its suite is tiny, this one's quick"):
            SuiteRun("quick", ["random"], tiny_run).run(resume=True)
        assert all_of(tiny_run) == before

    def test_run_when_folder_is_of_an_older_benchmark(self, tiny_run, tmp_path):
        content = json.loads((tiny_run / "suite.json").read_text())
        (tmp_path / "suite.json").write_text(json.dumps({**content, "benchmark": "v0"}))
        with pytest.raises(InputError, match="holds another run: its benchmark is v0, this one's v1"):
            SuiteRun("tiny", ["random"], tmp_path).run(resume=True)
        assert [path.name for path in tmp_path.iterdir()] == ["suite.json"]

    @pytest.mark.parametrize("resume", [False, True])
    def test_run_when_folder_holds_other_things(self, tmp_path, resume):
        (tmp_path / "thesis.tex").touch()
        with pytest.raises(InputError, match=r"expected an empty folder or a suite's, found 'thesis\.tex' in it"):
            SuiteRun("tiny", ["random"], tmp_path).run(resume=resume)
        assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]

    @pytest.mark.parametrize(
        "content",
        ["", "[]", "{}", '{"parts":["../x"],"folders":{}}', '{"parts":["a"],"folders":{"x":"/etc"}}', '{"parts":[1]}'],
    )
    def test_resume_when_suite_json_is_damaged(self, tiny_run, tmp_path, content):
        (tmp_path / "suite.json").write_text(content)
        with pytest.raises(InputError, match=r"suite\.json: expected "):
            SuiteRun("tiny", ["random"], tmp_path).run(resume=True)
        assert (tmp_path / "suite.json").read_text() == content

    def test_resume_when_a_record_was_edited(self, tiny_run, tmp_path):
        out = tmp_path / "out"
        shutil.copytree(tiny_run, out)
        (out / "random" / "near" / "summary.json").unlink()
        records = out / "random" / "near" / "episodes.jsonl"
        lines = records.read_text().splitlines(keepends=True)
        records.write_text("".join([lines[0].replace('"seed":', '"seed":1'), *lines[1:]]))
        edited = records.read_bytes()
        with pytest.raises(InputError, match=r"random/near: expected records of this run, found start, goal and seed"):
            SuiteRun("tiny", ["random"], out).run(resume=True)
        assert records.read_bytes() == edited


class TestFolderName:
    @pytest.mark.parametrize(
        ("agent", "folder"),
        [
            ("planner-closed-loop", "planner-closed-loop"),
            ("my.module:My_Agent", "my.module-My_Agent"),
            ("../x:Y", "agent..-x-Y"),
            ("a/b\\c:d e", "a-b-c-d-e"),
            (".", "agent."),
        ],
    )
    def test_name_when_agent_has_odd_letters(self, agent, folder):
        assert folder_name(agent) == folder


class TestCompareFolders:
    def test_comparison_when_of_suites(self, tiny_run):
        found = compare_folders(tiny_run / "planner", tiny_run / "random")
        assert list(found.parts) == ["near", "noise-0.5", "corners"]
        assert found.parts["corners"]["overall"]["success_rate_difference"] == 1.0
        assert found.title == f"A is planner in {tiny_run / 'planner'}, B is random in {tiny_run / 'random'}"
        assert found.notes == []

    def test_comparison_when_of_one_part(self, tiny_run):
        found = compare_folders(tiny_run / "planner" / "near", tiny_run / "random" / "near")
        assert list(found.parts) == [""]
        assert list(found.parts[""]["by_distance"]) == ["1", "2"]
        assert found.has_distances
        assert "; local, eval mazes 13 x 13" in found.title

    def test_comparison_when_a_part_is_missing(self, tiny_run, tmp_path):
        SuiteRun("tiny", ["random"], tmp_path / "b").run()
        (tmp_path / "b" / "random" / "near" / "summary.json").unlink()
        found = compare_folders(tiny_run / "random", tmp_path / "b")
        assert list(found.parts) == ["noise-0.5", "corners"]
        assert found.notes == [f"{tiny_run / 'random'}: near not in the other folder; left out"]
        for part in found.parts.values():
            assert part["overall"]["spl_difference_ci95"] == [0.0, 0.0]

    def test_comparison_when_folders_hold_no_results(self, tiny_run, tmp_path):
        agent = tiny_run / "random"
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "thesis.tex").touch()
        (tmp_path / "empty").mkdir()
        for folder, said in [
            (tiny_run, "expected one agent's results, found 2 agents'; name one of: .*planner, .*random"),
            (tmp_path / "none", "expected a finished evaluation, found nothing there"),
            (tmp_path / "empty", "expected a finished evaluation, found an empty folder"),
            (tmp_path / "other", r"expected a finished evaluation, found 'thesis\.tex' in it"),
            (tmp_path / "other" / "thesis.tex", "expected a finished evaluation, found a file"),
            (agent / "near", r"expected results of the same parts, found near, .* and a single evaluation in"),
        ]:
            with pytest.raises(InputError, match=said):
                compare_folders(agent, folder)
