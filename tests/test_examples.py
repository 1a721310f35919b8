"""The examples of docs: each script runs with a small budget, and the package is built, installed and evaluated."""

from __future__ import annotations

import importlib.util
import json
import pathlib
import re
import shutil

import cv2
import mujoco
import pytest
from processes import run_python

from mazebench.maps.maze_files import read_maze

EXAMPLES = pathlib.Path(__file__).parent.parent / "docs" / "examples"
# One thread: several slow each other down where other tests run at the same time.
SERIAL = {"OMP_NUM_THREADS": "1"}
PPO_BUDGET = ("--steps", "512", "--num-envs", "4", "--out", "ppo.zip")


def run(*arguments: str | pathlib.Path, folder: pathlib.Path, **variables: str) -> str:
    """Returns the standard output of a Python process, which must succeed."""
    return run_python(*arguments, cwd=folder, variables=SERIAL | {"TMPDIR": str(folder)} | variables).stdout


def needs(*modules: str) -> None:
    for module in modules:
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is not installed")


class TestScripts:
    @pytest.mark.parametrize(
        ("module", "script", "options", "printed"),
        [
            ("dm_env", "dm_env_loop.py", "--episodes 2", r"\Aepisode 0:.*\nepisode 1:.*\n\Z"),
            (
                "torch",
                "vector_dqn.py",
                "--steps 3000 --num-envs 16 --learning-starts 500 --target-updates 50",
                "156 updates; success rate ",
            ),
            (
                "torchrl",
                "torchrl_ppo.py",
                "--steps 512 --num-envs 8 --rollout 32 --batch-size 128",
                r"\A256 steps:.*\n512 steps:.*\n16 updates; ",
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
    def test_a_script_runs_with_a_small_budget(self, tmp_path, module, script, options, printed):
        needs(module)
        assert re.search(printed, run(EXAMPLES / script, *options.split(), folder=tmp_path))

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
    def test_sb3_her(self, tmp_path, flags, agent, side, options):
        needs("stable_baselines3")
        output = run(EXAMPLES / "sb3_her.py", "--steps", "320", "--out", "her.zip", *flags, folder=tmp_path)
        assert output.endswith(f"saved her.zip, which sb3_her_agent:{agent} plays\n")
        shutil.copy(EXAMPLES / "sb3_her_agent.py", tmp_path)
        check = f"""
import gymnasium, mazebench, numpy as np
from mazebench.testing import check_agent
from sb3_her_agent import {agent} as Agent

task = mazebench.Task.of(size={side}, context_size={side}, kinds='dfs')
check_agent('sb3_her_agent:{agent}', task, 'her.zip')
# Larger contexts of the same mazes are resized, but other mazes have other positions.
task = mazebench.Task.of(size={side}, context_size={2 * side}, kinds='dfs')
check_agent('sb3_her_agent:{agent}', task, 'her.zip')
try:
    task = mazebench.Task.of(size={side + 2}, context_size={side + 2}, kinds='dfs')
    Agent.build(task.interface, checkpoint='her.zip')
except mazebench.UnplayableError as error:
    assert 'expected mazes of {side} cells a side, found {side + 2}' in str(error), error
else:
    raise AssertionError('played')

# The agent sees what the goal-conditioned environment shows.
names = ("Local", "LocalGoal")
agent, envs = (
    Agent(None, {side}, {side}, 1.0), [gymnasium.make(f'mazebench/{{name}}-13-v1', **{options}) for name in names]
)
steps = [env.reset(seed=1) for env in envs]
for action in (0, 0, 2, 2, 4, 0, 0):
    (observation, *_), (shown, *_) = steps
    seen = agent.goal_conditioned({{name: values[None] for name, values in observation.items()}})
    assert seen.keys() == shown.keys()
    for name, values in shown.items():
        np.testing.assert_array_equal(seen[name][0], values)
    steps = [env.step(action) for env in envs]
"""
        run("-c", check, folder=tmp_path)

    @pytest.mark.parametrize(
        ("agent", "options"),
        [
            ("PPOAgent", ()),
            pytest.param("RecurrentPPOAgent", ("--recurrent", "--kinds", "dfs"), marks=pytest.mark.slow),
            pytest.param("PPOAgent", ("--features", "ways"), marks=pytest.mark.slow),
        ],
    )
    def test_sb3_tracks(self, tmp_path, agent, options):
        needs("stable_baselines3", "sb3_contrib")
        run(EXAMPLES / "sb3_tracks.py", *PPO_BUDGET, *options, folder=tmp_path)
        # The policy is an agent, also where contexts are larger than those that it was trained on.
        shutil.copy(EXAMPLES / "sb3_agent.py", tmp_path)
        which = ("--agent", f"sb3_agent:{agent}", "--checkpoint", "ppo.zip", "--distances", "15")
        run("-m", "mazebench", "eval", *which, "--track", "rough", "--out", "results", folder=tmp_path)
        assert json.loads((tmp_path / "results" / "summary.json").read_text())["episodes"] == 10
        check = (
            "from mazebench.testing import check_agent\n"
            f"check_agent('sb3_agent:{agent}', 'rough', 'ppo.zip', level=3)\n"
        )
        run("-c", check, folder=tmp_path)

    @pytest.mark.slow
    def test_sb3_tracks_on_a_task_without_lidar(self, tmp_path):
        needs("stable_baselines3", "sb3_contrib")
        run(EXAMPLES / "sb3_tracks.py", *PPO_BUDGET, "--track", "local", "--reward", "progress", folder=tmp_path)
        shutil.copy(EXAMPLES / "sb3_agent.py", tmp_path)
        which = ("--agent", "sb3_agent:MapPPOAgent", "--checkpoint", "ppo.zip", "--distances", "3", "--kinds", "dfs")
        run("-m", "mazebench", "eval", *which, "--num-mazes", "2", "--out", "results", folder=tmp_path)
        assert json.loads((tmp_path / "results" / "config.json").read_text())["sensors"] == []

    def test_pixels(self, tmp_path):
        needs("torch")
        probe = "import mujoco; mujoco.GLContext(64, 64).free()"
        egl = {"MUJOCO_GL": "egl"}
        if run_python("-c", probe, status=None, variables=egl).returncode:
            pytest.skip("EGL is not usable here")
        run(EXAMPLES / "pixels.py", "--steps", "2", "--out", "seen.png", folder=tmp_path, **egl)
        assert cv2.imread(str(tmp_path / "seen.png")).shape == (2 * 84, 4 * 84, 3)

    def test_own_maze(self, tmp_path):
        run(EXAMPLES / "own_maze.py", "--out", "mazes", folder=tmp_path)
        assert read_maze(tmp_path / "mazes" / "ring.txt").size == 7
        mujoco.MjModel.from_xml_path(str(tmp_path / "mazes" / "ring.xml"))
        options = ("--mazes", "mazes", "--distances", "1-6", "--out", "results")
        run("-m", "mazebench", "eval", "--agent", "planner", *options, folder=tmp_path)
        summary = json.loads((tmp_path / "results" / "summary.json").read_text())
        assert (summary["overall"]["n"], summary["overall"]["success_rate"]) == (30, 1.0)

    def test_dagger(self, tmp_path):
        needs("torch")
        assert len((EXAMPLES / "dagger.py").read_text(encoding="utf-8").splitlines()) < 150
        output = run(EXAMPLES / "dagger.py", "--steps", "2560", "--distances", "15", folder=tmp_path)
        success_rate = float(re.fullmatch(r"saved student\.pt; success rate on dev (.*), 9 episodes\n", output)[1])
        assert success_rate > 0  # a random agent reaches no goal 15 cells away


class TestPackage:
    """docs/examples/crow_agent, a package of somebody else's."""

    TINY = ("--distances", "1,2", "--episodes-per-distance", "1", "--out", "results")

    def test_length_when_counted(self):
        lines = (EXAMPLES / "crow_agent" / "crow_agent.py").read_text(encoding="utf-8").splitlines()
        assert len(lines) < 30

    @pytest.mark.parametrize("name", ["crow_agent.py", "pyproject.toml"])
    def test_file_when_compared_with_the_page(self, name):
        page = (EXAMPLES.parent / "custom_agents.md").read_text(encoding="utf-8")
        assert f"\n{(EXAMPLES / 'crow_agent' / name).read_text(encoding='utf-8')}```\n" in page

    def test_agent_when_its_package_is_installed(self, tmp_path):
        source, target = tmp_path / "crow_agent", tmp_path / "target"
        shutil.copytree(EXAMPLES / "crow_agent", source)  # the build leaves files behind
        offline = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check")
        run("-m", "pip", "install", "--quiet", *offline, "--target", target, source, folder=tmp_path)
        installed = {"PYTHONPATH": str(target)}
        assert "crow, " in run("-m", "mazebench", "list", folder=tmp_path, **installed)
        run("-m", "mazebench", "eval", "--agent", "crow", *self.TINY, folder=tmp_path, **installed)
        summary = json.loads((tmp_path / "results" / "summary.json").read_text())
        assert (summary["agent"], summary["overall"]["n"]) == ("crow", 40)
        assert summary["provenance"]["agent_package"] == "crow-agent 0.1.0"
        assert summary["by_distance"]["1"]["success_rate"] > 0.8  # nothing stands between neighbouring cells
        check = "import crow_agent, mazebench.testing; mazebench.testing.check_agent(crow_agent.Crow)"
        run("-c", check, folder=tmp_path, **installed)

    def test_agent_when_its_file_is_at_hand(self, tmp_path):
        shutil.copy(EXAMPLES / "crow_agent" / "crow_agent.py", tmp_path)
        run("-m", "mazebench", "eval", "--agent", "crow_agent:Crow", *self.TINY, folder=tmp_path)
        summary = json.loads((tmp_path / "results" / "summary.json").read_text())
        assert (summary["agent"], summary["overall"]["n"]) == ("crow_agent:Crow", 40)
