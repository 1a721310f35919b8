"""The bodies: that the default one is not written, and that another one is a file and an entry of a table."""

from __future__ import annotations

import json
import math
import pathlib
import shutil
import subprocess

import pytest
from processes import run_python
from simple_mazes import CART

from mazebench.errors import InputError
from mazebench.results.naming import described
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit
from mazebench.world.bodies import BODIES, SLIDER

ROOT = pathlib.Path(__file__).parent.parent
# The package of bodies with the body of the diff; the rest of mazebench is as it is, with its compiled kernels.
PROGRAM = """
import json, sys
import mazebench.world
mazebench.world.__path__.insert(0, sys.argv[1])
import mazebench
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.trials import select_trials

maze, folder = load_mazes(13, "train")[0], sys.argv[2]
for agent in ("oracle", "navigator"):
    for body in ("slider", "cart"):
        out = f"{folder}/{agent}-{body}"
        mazebench.evaluate(
            agent, mazes=maze, distances=[4, 9], episodes_per_distance=2, body=body, sensors="lidar", out=out
        )
frozen = [select_trials(mazebench.Task.of(split="eval", distances=[15], body=body), 1) for body in ("slider", "cart")]
print(json.dumps([[(trial.shortest_path, trial.oracle_steps) for trial in trials] for trials in frozen]))
"""


def test_the_default_body_is_not_written():
    task = Task.of()
    assert task.body is task.interface.body is SLIDER
    assert "body" not in task.options.to_json()
    assert "body" not in described(task.options)
    assert Task.from_json(task.options.to_json() | {"body": "slider"}) == task
    with pytest.raises(InputError, match="body"):
        Task.of(body="zeppelin")
    assert list(BODIES) == ["slider", "turtlebot3", "turtlebot3-waffle", "service"]


def test_a_slower_body_has_more_time():
    # A metre takes 2 steps of .512 m, or 4 of .256 m; a quarter turn 4 of 21 degrees.
    assert default_time_limit(20, 1.0, SLIDER, track="building") == (2 + 4) * 20 + 50
    assert default_time_limit(20, 1.0, CART, track="building") == (4 + 4) * 20 + 100


def test_a_body_says_how_it_moves():
    assert math.degrees(SLIDER.turn_rate) == pytest.approx(132)
    assert SLIDER.reach == pytest.approx(0.18)
    assert SLIDER.coasting_time == pytest.approx(1 / 8)
    assert CART.coasting_time == pytest.approx(2 / 8)
    # The drive and the damping balance at the top speed.
    assert SLIDER.drive_gain * (SLIDER.drive_speed - SLIDER.top_speed) == pytest.approx(8 * SLIDER.top_speed)


def test_the_body_of_the_diff_is_driven_by_oracle_and_navigator(tmp_path):
    bodies = tmp_path / "changed" / "mazebench" / "world" / "bodies"
    shutil.copytree(ROOT / "mazebench" / "world" / "bodies", bodies, ignore=shutil.ignore_patterns("__pycache__"))
    diff = ROOT / "docs" / "examples" / "extend" / "body.diff"
    subprocess.run(["git", "apply", diff], cwd=tmp_path / "changed", check=True)
    printed = run_python("-c", PROGRAM, bodies.parent, tmp_path).stdout

    def episodes(name: str) -> list[dict]:
        lines = (tmp_path / name / "episodes.jsonl").read_text(encoding="utf-8").splitlines()
        return [json.loads(line) for line in lines]

    # At half the speed it takes about twice the steps, and is on time for an oracle that drives the same body.
    for agent in ("oracle", "navigator"):
        for fast, slow in zip(episodes(f"{agent}-slider"), episodes(f"{agent}-cart"), strict=True):
            assert fast["success"]
            assert slow["success"]
            assert 1.7 < slow["steps"] / fast["steps"] < 2.4
            assert slow["oracle_steps"] <= slow["steps"] <= 1.25 * slow["oracle_steps"]
            assert slow["path_length"] / (0.16 * slow["steps"]) < 1.6  # m/s
            assert slow["shortest_path"] >= fast["shortest_path"]  # a wider body gets less near to corners
    assert json.loads((tmp_path / "oracle-cart" / "config.json").read_text(encoding="utf-8"))["body"] == "cart"
    assert "body" not in json.loads((tmp_path / "oracle-slider" / "config.json").read_text(encoding="utf-8"))

    # What is frozen is the slider's.
    slider, cart = json.loads(printed)
    assert all(steps is not None for _, steps in slider)
    assert all(steps is None for _, steps in cart)
    assert all(wide > narrow for (wide, _), (narrow, _) in zip(cart, slider, strict=True))
