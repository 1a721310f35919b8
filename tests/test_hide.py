"""The option `hide`: what the context does not show, who is told, and what it refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

import mazebench
from mazebench.agent import SingleAgent
from mazebench.envs.goal import GoalMazeEnv
from mazebench.errors import InputError, UnplayableError
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import build_agent, make_plan
from mazebench.tasks.context import GLOBAL_MAP, GOAL, LOCAL_MAP, START
from mazebench.tasks.task import Task


@pytest.mark.parametrize(
    ("hide", "zero"), [(("map",), (GLOBAL_MAP, LOCAL_MAP)), (("map", "goal"), (GLOBAL_MAP, LOCAL_MAP, GOAL))]
)
def test_planes_are_zero_and_all_else_is_as_it_was(hide, zero):
    shown, hidden = (mazebench.make_vec("local", 3, seed=5, sensors=("lidar",), hide=names) for names in ((), hide))
    for action in (None, 0, 4):
        observations = [
            env.reset()[0] if action is None else env.step(np.full(3, action))[0] for env in (shown, hidden)
        ]
        for plane in (GLOBAL_MAP, LOCAL_MAP, GOAL, START):
            expected = 0 if plane in zero else observations[0]["context"][:, plane]
            np.testing.assert_array_equal(observations[1]["context"][:, plane], expected)
        for name in ("state", "lidar"):
            np.testing.assert_array_equal(observations[0][name], observations[1][name])


class Asks(SingleAgent):
    """Keeps what it is told, and stands still."""

    told: tuple[str, ...] = ()

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        Asks.told = interface.hidden
        return cls()

    def act(self, observation):
        return 4


def test_the_agent_and_the_summary_are_told(tmp_path):
    summary = evaluate(Asks, out=tmp_path / "run", hide=("goal", "map"), distances=(1,), episodes_per_distance=1)
    assert Asks.told == ("map", "goal")
    assert summary.task.hide == ("map", "goal")
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["task"]["hide"] == ["map", "goal"]
    assert summary.who.endswith("Asks without map and goal")
    line = json.loads((tmp_path / "run" / "episodes.jsonl").read_text().splitlines()[0])
    assert "hide" not in line  # records do not change


def build(agent, **options):
    plan = make_plan(eval_options(agent, **options))
    return build_agent(plan.options, plan.task, plan.agent_class)


@pytest.mark.parametrize("agent", ["planner", "planner-closed-loop"])
def test_agents_that_need_what_is_hidden_are_refused(agent):
    with pytest.raises(UnplayableError, match=f"agent '{agent}': needs the map, found it hidden"):
        build(agent, hide=("map",))


def test_the_navigator_plays_without_map_and_goal():
    build("navigator", task="building", split="dev", hide=("map", "goal"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hide": ("map", "goal"), "sensors": ("egocentric",)}, "without 'egocentric', which shows where the goal is"),
        ({"hide": ("map", "map")}, "expected each hide once, found map, map"),
        (
            {"hide": ("map",), "task": "hierarchical"},
            "hide map: expected the task 'local' or a track, found 'hierarchical'",
        ),
        ({"hide": ("map",), "num_goals": 2}, "hide map: expected num_goals 1, found 2"),
        ({"hide": ("start",)}, "hide"),
    ],
)
def test_what_would_tell_is_refused_in_a_line(options, message):
    with pytest.raises(InputError, match=message) as caught:
        Task.of(**options)
    assert "\n" not in str(caught.value)


def test_an_egocentric_camera_may_look_for_a_marked_goal():
    assert Task.of(hide=("map",), sensors=("egocentric",)).options.hide == ("map",)


def test_goal_conditioned_environments_refuse_it():
    with pytest.raises(InputError, match=r"goal-conditioned environment: expected .*no hide"):
        GoalMazeEnv(Task.of(hide=("goal",)))
