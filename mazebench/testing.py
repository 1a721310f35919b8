"""A conformance check for other people's agents, to call in their tests."""

from __future__ import annotations

import contextlib
import itertools
import pathlib
import pickle
from collections.abc import Sequence
from typing import Any

import numpy as np

from mazebench.agent import Agent, Inputs, SingleAgent
from mazebench.agent_loading import checked_agent_class, load_agent_class
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.evaluation.checked_agent import AgentError, CheckedAgent, calling
from mazebench.evaluation.plan import task_as_played
from mazebench.maps.kinds import generate
from mazebench.rollout import agent_seed, rollout
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.task import Task, as_asked, resolve
from mazebench.tasks.task_options import TaskOptions

_SIZE = 7
_NUM_MAZES = 3  # of different paths between their corners, so that episodes side by side end at different steps
_TIME_LIMIT = 5  # steps a leg: whatever an agent does, all landmarks come up
_NUM_STEPS = 20  # of an episode, and as many more as its number is
_ORDER = ((0, 3), (1, 4), (2, 5))  # the episodes' numbers in three slots, each slot's one after another


class ConformanceError(AssertionError):
    """An agent breaks its contract; the message says which, what was expected and what was found."""


def check_agent(
    agent_class: type[Agent] | type[SingleAgent] | str,
    task: Task | TaskOptions | str | None = None,
    checkpoint: pathlib.Path | str | None = None,
    **options: Any,
) -> None:
    """Builds an agent and lets it act in a few short episodes, as an evaluation would.

        >>> check_agent("my_agent:MyAgent", "rough", level=3)

    Checks that every answer is an action for each environment and a state, and that the agent leaves its inputs as they
    are. Then the same episodes are played again: by an agent built anew, by one agent in two batches by turns, in
    another order, in other slots, and one at a time. The actions in an episode must be the same each time.

    Args:
      agent_class: the class, or what `--agent` takes.
      task: what is played, or its name for `Task.of`: "local", "hierarchical" or a track; by default hierarchical
        navigation in 7 x 7 mazes, whose episodes have several legs. The agent gets sensors that it needs, and actions
        that it plays.
      checkpoint: passed on to `build`.
      **options: those of `Task.of`, besides a name.

    Raises:
      ConformanceError: at the first thing that is wrong.
      InputError: if no agent has the given name, the agent can't use the checkpoint, or there is no such task.
    """
    if isinstance(agent_class, str):
        agent_class = load_agent_class(agent_class)
    name = getattr(agent_class, "__name__", repr(agent_class))
    try:
        checked = checked_agent_class(name, agent_class)
    except InputError as error:
        raise ConformanceError(str(error)) from error
    if task is None:
        rng = np.random.default_rng(0)
        mazes = tuple(generate("dfs", _SIZE, rng, f"maze-{index}") for index in range(_NUM_MAZES))
        task = TaskOptions(task="hierarchical", mazes=mazes, time_limit=_TIME_LIMIT, landmark_distance=3)
    asked = as_asked(task, options)
    try:
        played = task_as_played(name, checked, asked, resolve)
        _check_acting(name, checked, played, None if checkpoint is None else pathlib.Path(checkpoint))
    except AgentError as error:
        raise ConformanceError(str(error)) from error


def _check_acting(name: str, agent_class: type[Agent], task: Task, checkpoint: pathlib.Path | None) -> None:
    interface, rng = task.interface, np.random.default_rng(0)
    episodes = [sample_episode(task, rng) for _ in itertools.chain(*_ORDER)]

    def build() -> CheckedAgent:
        with calling(name, "build"):
            return _CarefulAgent(name, agent_class.build(interface, checkpoint=checkpoint), interface.actions)

    def play(agent: CheckedAgent, *orders: Sequence[Sequence[int]]) -> dict[int, list[Any]]:
        """Returns the agent's actions by episode in the first of some batches that it plays by turns."""
        with contextlib.ExitStack() as stack:
            batches = [
                stack.enter_context(contextlib.closing(_ShortEpisodes(task, episodes, order))) for order in orders
            ]
            truth = agent_class.needs_truth
            rollouts = [rollout(agent, envs, envs.reset(), envs.seeds, needs_truth=truth) for envs in batches]
            for steps in itertools.zip_longest(*rollouts):
                for step in filter(None, steps):
                    agent.report(step.state)
        return batches[0].actions

    expected = play(build(), _ORDER)
    own_slot = "let an action depend on nothing but the inputs and the state of its own slot"
    for when, found, advice in (
        (
            "when built anew from the same seed",
            play(build(), _ORDER),
            "make weights in build() from its seed, and draw random numbers only from generators made of inputs.seed",
        ),
        (
            "when another batch is played by turns",
            play(build(), _ORDER, _ORDER[::-1]),
            "keep all memory, generators too, in the state that act() returns, and nothing on self",
        ),
        (
            "after another episode",
            play(build(), [numbers[::-1] for numbers in _ORDER]),
            "begin anew where inputs.new_episode is set",
        ),
        ("in another slot of the batch", play(build(), _ORDER[::-1]), own_slot),
        ("alone", play(build(), _ORDER[:1]), own_slot),
    ):
        if found != {number: expected[number] for number in found}:
            same = f"expected the same actions in an episode {when}, found others"
            raise ConformanceError(f"agent {name!r}: {same}; {advice}")


class _CarefulAgent(CheckedAgent):
    """A checked agent that must leave its inputs as they are."""

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        before = pickle.dumps(inputs)
        actions, state = super().act(inputs, state, explore)
        if pickle.dumps(inputs) != before:
            raise ConformanceError(f"agent {self.name!r}: expected act() to leave its inputs; change a copy")
        return actions, state


class _ShortEpisodes(MazeVectorEnv):
    """Some of the episodes that an agent is checked in; of those side by side, each is cut at another step."""

    def __init__(self, task: Task, episodes: Sequence[Episode], order: Sequence[Sequence[int]]):
        """`order` has the numbers of the episodes in each environment, one after another."""
        self._all_episodes, self._waiting = episodes, [list(numbers) for numbers in order]
        self._numbers = np.full(len(order), -1)  # of the episodes under way; -1 where none is left
        self.actions: dict[int, list[Any]] = {}  # by the numbers of the episodes
        super().__init__(task, len(order), num_threads=1, episode_source=self._next_episode, autoreset_mode="Disabled")

    def _next_episode(self, slot: int) -> Episode | None:
        self._numbers[slot] = number = self._waiting[slot].pop(0) if self._waiting[slot] else -1
        return None if number < 0 else self._all_episodes[number]

    def seeds(self, slots: np.ndarray) -> list[int]:
        """Returns the seeds of the agent's own draws in the episodes of environments `slots`."""
        return [agent_seed(0, number) for number in self._numbers[slots].tolist()]

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        """Takes a step, and begins the next episodes where one ended or was cut."""
        for slot in np.flatnonzero(self.rules.active).tolist():
            self.actions.setdefault(self._numbers.item(slot), []).append(actions[slot].tolist())
        observation, reward, terminated, truncated, info = super().step(actions)
        truncated = truncated | (self.rules.active & (info["steps"] >= _NUM_STEPS + self._numbers))
        if (ended := terminated | truncated).any():
            observation, info = self.reset(options={"reset_mask": ended})
        return observation, reward, terminated, truncated, info
