"""The sequences drawn in docs/tasks.md, played in all environments: each row is a call and what it returns."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from pages import ROOT, read

from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.tasks.context import GOAL, START
from mazebench.tasks.episode import Episode
from mazebench.tasks.spec import TaskSpec

PAGE = read(ROOT / "docs" / "tasks.md")
CODE_OR_TABLE = r"^```python\n(?P<code>.*?)^```$|^(?P<head>\| call \|[^\n]*)\n\|[-|]+\|\n(?P<rows>(?:\|[^\n]*\n)+)"

Row = dict[str, str]  # a cell by the name of its column


def cells(line: str) -> list[str]:
    return [cell.strip(" `") for cell in line.split("|")[1:-1]]


def sequences() -> list[tuple[TaskSpec, Episode, list[Row]]]:
    """The task and the episode of each table, which the code before it makes, and its rows."""
    found, names = [], {}
    for part in re.finditer(CODE_OR_TABLE, PAGE, re.DOTALL | re.MULTILINE):
        if part["code"]:
            exec(compile(part["code"], "tasks.md", "exec"), names)
        else:
            rows = [dict(zip(cells(part["head"]), cells(line), strict=True)) for line in part["rows"].splitlines()]
            found.append((names["env"].task.spec, names["episode"], rows))
    return found


def actions_of(rows: list[Row]) -> list[int]:
    return [int(row["call"].removeprefix("step(").removesuffix(")")) for row in rows[1:]]


def written(value: Any) -> str:
    """A value as the page writes it."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    return "" if value is None else f"{value:g}"


def leads(context: np.ndarray) -> str:
    """The cells between which a context leads, whose planes are as large as the maze."""
    start, goal = (tuple(np.argwhere(context[plane])[0].tolist()) for plane in (START, GOAL))
    return f"{start} to {goal}"


def gymnasium_row(context: np.ndarray, reward: Any, terminated: Any, truncated: Any, is_first: bool) -> Row:
    values = {"reward": reward, "terminated": terminated, "truncated": truncated, "is_first": is_first}
    return {"context": leads(context)} | {name: written(value) for name, value in values.items()}


def test_every_row_is_what_the_call_returns():
    *single, (spec, episode, rows_of_vector) = sequences()
    assert len(single) == 5
    for task, begun, rows in single:
        env, gymnasium_env = Environment(task), MazeEnv(task)
        observation, info = gymnasium_env.reset(options={"episode": begun})
        time_steps = [env.reset(episode=begun), *map(env.step, actions_of(rows))]
        returned = [(observation, None, None, None, info), *map(gymnasium_env.step, actions_of(rows))]
        for time_step, (observation, *outcome, info), row in zip(time_steps, returned, rows, strict=True):
            found = gymnasium_row(observation["context"], *outcome, info["is_first"])
            found |= {"step type": time_step.step_type.name, "discount": written(time_step.discount)}
            assert row == row | found
            assert (leads(time_step.observation["context"]), written(time_step.reward)) == (
                row["context"],
                row["reward"],
            )

    envs = MazeVectorEnv(spec, 2, episode_source=lambda number: episode)
    observations, infos = envs.reset()
    returned = [(observations, *[(None, None)] * 3, infos)]
    returned += [envs.step(np.full(2, action)) for action in actions_of(rows_of_vector)]
    for (observations, *outcome, infos), row in zip(returned, rows_of_vector, strict=True):
        found = gymnasium_row(observations["context"][1], *(values[1] for values in outcome), infos["is_first"][1])
        assert row == row | found | {"landmark": written(infos["landmark"][1])}
        assert ("final_obs" in infos) == bool(row["final_obs"])
