"""The whole additions of the page on extending, applied to a copy of the code and played."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).parent.parent
DIFFS = ROOT / "docs" / "examples" / "extend"
PLAYED = {
    "building": """
        import gymnasium
        import numpy as np

        import mazebench

        # The maze is the building, and more is open on its map.
        env = gymnasium.make("mazebench/Closed-v1", level=2)
        env.reset(seed=0)
        rules = env.unwrapped.runner.rules
        walls, shown = env.unwrapped.task.mazes[rules.maze[0]].walls, rules.shown[0].walls
        assert ((walls & ~shown).sum(), (shown & ~walls).sum()) == (4, 0)

        # A maze of one's own is the plan, and more is closed in its buildings.
        plan = mazebench.generate("rooms", 31, np.random.default_rng(0))
        task = mazebench.Task.of("closed", level=3, mazes=plan)
        assert [((maze.walls & ~plan.walls).sum(), (plan.walls & ~maze.walls).sum()) for maze in task.mazes] == [
            (8, 0)
        ] * 4
        assert len({maze.walls.tobytes() for maze in task.mazes}) == 4
        env = mazebench.make(task)
        env.reset(seed=0)
        assert (env.unwrapped.runner.rules.shown[0].walls == plan.walls).all()
        env.step(0)
    """,
    "noisy_sensor": """
        import copy
        import json
        import pathlib

        import numpy as np

        import mazebench
        from mazebench.results.naming import noise_in_words

        options = {"sensors": ("compass",), "compass_noise": 5.0}
        env = mazebench.make("local", **options)
        errors = [env.reset(seed=0)[0]["compass"].item() - env.unwrapped.runner.rules.pose[0, 2]]
        copied = copy.deepcopy(env)
        for action in range(6):
            observation, *_, info = env.step(action)
            errors.append((observation["compass"].item() - info["yaw"] + np.pi) % (2 * np.pi) - np.pi)
            assert copied.step(action)[0]["compass"] == observation["compass"]
        assert 1 < np.degrees(np.std(errors)) < 15

        envs = mazebench.make_vec("local", 2, **options)
        assert envs.reset(seed=0)[0]["compass"][0] == env.reset(seed=0)[0]["compass"]
        summary = mazebench.evaluate("random", distances=(2,), episodes_per_distance=1, out="run", **options)
        record = json.loads(pathlib.Path("run/episodes.jsonl").read_text().splitlines()[0])
        assert record["compass_noise"] == summary.task.compass_noise == 5.0
        assert noise_in_words(summary.task) == ("compass noise 5.0",)
        try:
            mazebench.Task.of(compass_noise=5.0)
        except mazebench.errors.InputError as error:
            assert str(error) == "compass_noise 5.0: expected the sensor compass, found none"
    """,
}


@pytest.mark.parametrize("name", PLAYED)
def test_an_addition_is_played(name, tmp_path):
    shutil.copytree(ROOT / "mazebench", tmp_path / "mazebench")  # with compiled kernels
    subprocess.run(["git", "apply", DIFFS / f"{name}.diff"], cwd=tmp_path, check=True)
    script = "\n".join(line.removeprefix(" " * 8) for line in PLAYED[name].splitlines())
    played = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        text=True,
        capture_output=True,
    )
    assert played.returncode == 0, played.stderr
