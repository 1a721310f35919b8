"""The sequences drawn in docs/tasks.md, played in all environments: each row is a call and what it returns."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from pages import ROOT, read

from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.tasks.context import GOAL, START
from mazebench.tasks.episode import Episode
from mazebench.tasks.spec import TaskSpec

PAGE = read(ROOT / "docs" / "tasks.md")
CODE = r"^```python\n(?P<code>.*?)^```$"
TABLE = r"^(?P<table>\| call \|[^\n]*\n\|[-|]+\|\n(?:\|[^\n]*\n)+)"
NUM_TABLES = PAGE.count("\n| call |")  # the last one is of the vector environment

Row = dict[str, str]  # a cell by the name of its column
Observation = dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Sequence:
    """A table, and the episode that the code before it begins."""

    spec: TaskSpec
    episode: Episode
    rows: list[Row]

    @property
    def actions(self) -> list[int]:
        """What is done after the reset, by the calls."""
        assert self.rows[0]["call"] == "reset()"
        return [int(row["call"].removeprefix("step(").removesuffix(")")) for row in self.rows[1:]]

    @property
    def next_episode(self) -> Episode:
        """Another one, to follow."""
        return dataclasses.replace(self.episode, yaw=1.0)


@pytest.fixture(scope="module")
def sequences() -> list[Sequence]:
    """All of the page, in order."""
    found, names = [], {}
    for part in re.finditer(f"{CODE}|{TABLE}", PAGE, re.DOTALL | re.MULTILINE):
        if part["code"]:
            exec(compile(part["code"], "tasks.md", "exec"), names)
        else:
            lines = [[cell.strip(" `") for cell in line.split("|")[1:-1]] for line in part["table"].splitlines()]
            rows = [dict(zip(lines[0], line, strict=True)) for line in lines[2:]]
            found.append(Sequence(names["env"].task.spec, names["episode"], rows))
    assert len(found) == NUM_TABLES == 6
    return found


def word(value: Any) -> str:
    """A value as the page writes it."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    return "" if value is None else f"{value:g}"


def leads(observation: Observation) -> str:
    """The cells between which the context leads, whose planes are as large as the maze."""
    start, goal = (tuple(np.argwhere(observation["context"][plane])[0].tolist()) for plane in (START, GOAL))
    return f"{start} to {goal}"


def play_dm_env(sequence: Sequence) -> list[tuple[Observation, Row]]:
    """What each call returns, and how it reads."""
    env = Environment(sequence.spec)
    time_steps = [env.reset(episode=sequence.episode), *map(env.step, sequence.actions)]
    return [(each.observation, dm_env_row(each)) for each in time_steps]


def dm_env_row(time_step: Any) -> Row:
    row = {
        "step type": time_step.step_type.name,
        "reward": word(time_step.reward),
        "discount": word(time_step.discount),
        "context": leads(time_step.observation),
    }
    is_first = time_step.observation.get("is_first")  # there in the hierarchical task
    return row if is_first is None else row | {"is_first": word(bool(is_first))}


def play_gymnasium(sequence: Sequence) -> list[tuple[Observation, Row]]:
    """The same of the Gymnasium environment."""
    env = MazeEnv(sequence.spec)
    observation, info = env.reset(options={"episode": sequence.episode})
    returned = [(observation, None, None, None, info), *map(env.step, sequence.actions)]
    return [(each[0], gymnasium_row(*each)) for each in returned]


def gymnasium_row(observation: Observation, reward: Any, terminated: Any, truncated: Any, info: dict) -> Row:
    return {
        "reward": word(reward),
        "terminated": word(terminated),
        "truncated": word(truncated),
        "is_first": word(info["is_first"]),
        "landmark": word(info["landmark"]),
        "context": leads(observation),
    }


def play_vector(sequence: Sequence) -> list[tuple[Observation, Row, Observation | None]]:
    """The same of one of two in the vector environment, and `final_obs`."""
    episodes = [iter([sequence.episode, sequence.next_episode]) for _ in range(2)]
    env = MazeVectorEnv(sequence.spec, 2, episode_source=lambda number: next(episodes[number]))
    observations, infos = env.reset()
    returned = [(observations, [None] * 2, [None] * 2, [None] * 2, infos)]
    returned += [env.step(np.full(2, action)) for action in sequence.actions]
    played = []
    for observations, *outcome, infos in returned:
        observation = {name: values[1] for name, values in observations.items()}
        info = {name: infos[name][1] for name in ("is_first", "landmark")}
        row = gymnasium_row(observation, *(values[1] for values in outcome), info)
        played.append((observation, row, infos["final_obs"][1] if "final_obs" in infos else None))
    return played


def named_observations(sequence: Sequence) -> dict[str, Observation]:
    """By the page's names: o0 and on, and p0, the first one of the next episode."""
    named = {f"o{number}": observation for number, (observation, _) in enumerate(play_dm_env(sequence))}
    return named | {"p0": Environment(sequence.spec).reset(episode=sequence.next_episode).observation}


def assert_same(found: Observation, expected: Observation) -> None:
    for name in ("state", "context"):
        np.testing.assert_array_equal(found[name], expected[name])


def assert_drawn(found: Row, drawn: Row) -> None:
    """What was found is what the page has, in the columns that both have."""
    assert found == found | {name: cell for name, cell in drawn.items() if name in found}


@pytest.mark.parametrize("number", range(NUM_TABLES - 1))
class TestEpisode:
    def test_dm_env_when_played(self, sequences, number):
        for index, ((_, found), drawn) in enumerate(
            zip(play_dm_env(sequences[number]), sequences[number].rows, strict=True)
        ):
            assert_drawn(found, drawn)
            assert drawn["observation"] == f"o{index}"

    def test_gymnasium_when_played(self, sequences, number):
        named = named_observations(sequences[number])
        for (observation, found), drawn in zip(play_gymnasium(sequences[number]), sequences[number].rows, strict=True):
            assert_drawn(found, drawn)
            assert_same(observation, named[drawn["observation"]])

    def test_vector_environment_when_played(self, sequences, number):
        *played, (new, last_row, final) = play_vector(sequences[number])
        *rows, last_drawn = sequences[number].rows
        named = named_observations(sequences[number])
        for (observation, found, _), drawn in zip(played, rows, strict=True):
            assert_drawn(found, drawn)
            assert_same(observation, named[drawn["observation"]])
        assert_same(new, named["p0"])
        assert_same(final, named[last_drawn["observation"]])
        outcome = {name: last_drawn[name] for name in ("reward", "terminated", "truncated")}
        assert_drawn(last_row, outcome | {"is_first": "yes", "landmark": "0"})

    def test_call_after_the_end(self, sequences, number):
        sequence = sequences[number]
        env, gymnasium_env = Environment(sequence.spec), MazeEnv(sequence.spec)
        env.reset(episode=sequence.episode)
        gymnasium_env.reset(options={"episode": sequence.episode})
        for action in sequence.actions:
            env.step(action)
            gymnasium_env.step(action)
        assert env.step(0).first()
        with pytest.raises(gymnasium.error.ResetNeeded):
            gymnasium_env.step(0)


def test_table_of_the_vector_environment_when_played(sequences):
    named = named_observations(sequences[-1])
    for (observation, found, final), drawn in zip(play_vector(sequences[-1]), sequences[-1].rows, strict=True):
        assert_drawn(found, drawn)
        assert_same(observation, named[drawn["observation"]])
        assert (final is None) == (drawn["final_obs"] == "")
        if final is not None:
            assert_same(final, named[drawn["final_obs"]])
