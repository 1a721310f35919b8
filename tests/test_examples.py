"""The examples of docs: each script runs with a small budget, and the package is built, installed and evaluated."""

from __future__ import annotations

import importlib
import importlib.util
import json
import pathlib
import re
import runpy
import shutil
import sys
import textwrap

import cv2
import gymnasium
import mujoco
import numpy as np
import pytest
from processes import run_python

import mazebench
from mazebench.maps.maze_files import read_maze
from mazebench.testing import check_agent

EXAMPLES = pathlib.Path(__file__).parent.parent / "docs" / "examples"
PPO_BUDGET = ("--steps", "128", "--num-envs", "2", "--out", "ppo.zip")


@pytest.fixture
def script(tmp_path, monkeypatch, capsys):
    """Runs an example in this process, in an empty working directory; returns what it prints."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(EXAMPLES)

    def run(name: str, *options: str) -> str:
        monkeypatch.setattr(sys, "argv", [name, *options])
        capsys.readouterr()
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run


def needs(*modules: str) -> None:
    for module in modules:
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is not installed")


class TestScripts:
    @pytest.mark.parametrize(
        ("module", "name", "options", "printed"),
        [
            ("dm_env", "dm_env_loop.py", "--episodes 2", r"\Aepisode 0:.*\nepisode 1:.*\n\Z"),
            (
                "torch",
                "vector_dqn.py",
                "--steps 640 --num-envs 16 --learning-starts 320 --target-updates 10",
                "21 updates; success rate ",
            ),
            (
                "torchrl",
                "torchrl_ppo.py",
                "--steps 128 --num-envs 4 --rollout 16 --batch-size 64",
                r"\A64 steps:.*\n128 steps:.*\n8 updates; ",
            ),
            pytest.param(
                "torchrl",
                "torchrl_ppo.py",
                "--id mazebench/Rebuilt-v1 --reward progress --steps 256 --num-envs 4 --rollout 32 --batch-size 128",
                r"\A128 steps:.*\n256 steps:.*\n8 updates; ",
                marks=pytest.mark.slow,
            ),
            ("stable_baselines3", "sb3_continuous.py", "--steps 110", " drove "),
        ],
    )
    def test_a_script_runs_with_a_small_budget(self, script, module, name, options, printed):
        needs(module)
        assert re.search(printed, script(name, *options.split()))

    @pytest.mark.parametrize(
        ("flags", "agent", "side", "options"),
        [
            ((), "HerAgent", 13, {}),
            pytest.param(
                *(("--tracks",), "LidarHerAgent", 31),
                {"size": 31, "context_size": 31, "fresh": True, "sensors": "lidar"},
                marks=pytest.mark.slow,
            ),
        ],
    )
    def test_sb3_her(self, script, flags, agent, side, options):
        needs("stable_baselines3")
        output = script("sb3_her.py", "--steps", "220", "--out", "her.zip", *flags)
        assert output.endswith(f"saved her.zip, which sb3_her_agent:{agent} plays\n")
        task = mazebench.Task.of(size=side, context_size=side, kinds="dfs")
        check_agent(f"sb3_her_agent:{agent}", task, "her.zip")
        her_agent = getattr(importlib.import_module("sb3_her_agent"), agent)
        task = mazebench.Task.of(size=side + 2, context_size=side + 2, kinds="dfs")
        said = f"expected mazes of {side} cells a side, found {side + 2}"
        with pytest.raises(mazebench.UnplayableError, match=said):
            her_agent.build(task.interface, checkpoint="her.zip")

        # The agent sees what the goal-conditioned environment shows.
        envs = [gymnasium.make(f"mazebench/{name}-13-v1", **options) for name in ("Local", "LocalGoal")]
        steps = [env.reset(seed=1) for env in envs]
        for action in (0, 0, 2, 2, 4, 0, 0):
            (observation, *_), (shown, *_) = steps
            batch = {name: values[None] for name, values in observation.items()}
            seen = her_agent(None, side, side, 1.0).goal_conditioned(batch)
            assert seen.keys() == shown.keys()
            for name, values in shown.items():
                np.testing.assert_array_equal(seen[name][0], values)
            steps = [env.step(action) for env in envs]

    @pytest.mark.parametrize(
        ("agent", "options"),
        [
            ("FieldPPOAgent", ()),
            pytest.param("FieldRecurrentPPOAgent", ("--recurrent", "--hide", "map"), marks=pytest.mark.slow),
            pytest.param("PPOAgent", ("--features", "map", "--track", "rebuilt", "--kinds"), marks=pytest.mark.slow),
            pytest.param("RecurrentPPOAgent", ("--features", "map", "--recurrent"), marks=pytest.mark.slow),
            pytest.param("PPOAgent", ("--features", "ways"), marks=pytest.mark.slow),
        ],
    )
    def test_sb3_tracks(self, script, command, agent, options):
        needs("stable_baselines3", "sb3_contrib")
        script("sb3_tracks.py", *PPO_BUDGET, *options)
        # The policy is an agent, also where contexts are larger than those that it was trained on.
        which = ("--agent", f"sb3_agent:{agent}", "--checkpoint", "ppo.zip", "--distances", "15")
        assert command("eval", *which, "--track", "rough", "--out", "results")[0] == 0
        assert json.loads(pathlib.Path("results", "summary.json").read_text())["episodes"] == 9

    @pytest.mark.slow
    def test_sb3_tracks_on_a_task_without_lidar(self, script, command):
        needs("stable_baselines3", "sb3_contrib")
        script("sb3_tracks.py", *PPO_BUDGET, "--track", "local", "--features", "map")
        which = ("--agent", "sb3_agent:MapPPOAgent", "--checkpoint", "ppo.zip", "--distances", "3", "--kinds", "dfs")
        assert command("eval", *which, "--num-mazes", "2", "--out", "results")[0] == 0
        assert json.loads(pathlib.Path("results", "config.json").read_text())["sensors"] == []

    def test_pixels(self, tmp_path):
        needs("torch")
        run_python(EXAMPLES / "pixels.py", "--steps", "2", "--out", "seen.png", cwd=tmp_path)
        assert cv2.imread(str(tmp_path / "seen.png")).shape == (2 * 84, 4 * 84, 3)

    def test_own_maze(self, script, command, tmp_path):
        script("own_maze.py", "--out", "mazes")
        assert read_maze(tmp_path / "mazes" / "ring.txt").size == 7
        mujoco.MjModel.from_xml_path(str(tmp_path / "mazes" / "ring.xml"))
        assert (
            command("eval", "--agent", "planner", "--mazes", "mazes", "--distances", "1-6", "--out", "results")[0] == 0
        )
        summary = json.loads((tmp_path / "results" / "summary.json").read_text())
        assert (summary["overall"]["n"], summary["overall"]["success_rate"]) == (30, 1.0)

    def test_the_tutorial_on_imitation_has_the_code_of_dagger(self):
        code = (EXAMPLES / "dagger.py").read_text(encoding="utf-8")
        blocks = re.findall(r"```python\n(.*?)```", (EXAMPLES.parent / "tutorials" / "imitation.md").read_text(), re.S)
        assert len(blocks) == 4
        for block in blocks:
            assert block in code or textwrap.indent(block, "    ") in code

    def test_dagger(self, script):
        needs("torch")
        output = script("dagger.py", "--steps", "1280", "--distances", "15")
        assert re.fullmatch(r"saved student; success rate on dev (.*), 9 episodes\n", output)


class TestPackage:
    """docs/examples/crow_agent, a package of somebody else's."""

    @pytest.mark.parametrize("name", ["crow_agent.py", "pyproject.toml"])
    def test_file_when_compared_with_the_page(self, name):
        page = (EXAMPLES.parent / "custom_agents.md").read_text(encoding="utf-8")
        assert f"\n{(EXAMPLES / 'crow_agent' / name).read_text(encoding='utf-8')}```\n" in page

    def test_agent_when_its_package_is_installed(self, command, tmp_path, monkeypatch):
        source, target = tmp_path / "crow_agent", tmp_path / "target"
        shutil.copytree(EXAMPLES / "crow_agent", source)  # the build leaves files behind
        offline = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check")
        run_python("-m", "pip", "install", "--quiet", *offline, "--target", target, source)
        monkeypatch.syspath_prepend(target)
        assert "crow, " in command("list")[1]
        assert (
            command("eval", "--agent", "crow", "--distances", "1", "--episodes-per-distance", "1", "--out", "out")[0]
            == 0
        )
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert (summary["agent"], summary["overall"]["n"]) == ("crow", 20)
        assert summary["provenance"]["agent_package"] == "crow-agent 0.1.0"
        assert summary["overall"]["success_rate"] > 0.8  # nothing stands between neighbouring cells
        check_agent(importlib.import_module("crow_agent").Crow)
