"""A conformance check for other people's agents, to call in their tests."""

from __future__ import annotations

import contextlib
import itertools
import pathlib
import pickle
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mazebench.agent import Agent, Inputs, SingleAgent
from mazebench.agent_loading import checked_agent_class, load_agent_class
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.evaluation.agent_inputs import agent_seed, true_state
from mazebench.evaluation.checked_agent import AgentError, CheckedAgent, calling
from mazebench.evaluation.plan import task_as_played
from mazebench.maps.kinds import generate
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.task import Task, as_options, resolve
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
    asked = as_options(_small_task() if task is None else task, options)
    try:
        played = task_as_played(name, checked, asked, resolve)
        _check_acting(name, checked, played, None if checkpoint is None else pathlib.Path(checkpoint))
    except AgentError as error:
        raise ConformanceError(str(error)) from error


def _small_task() -> TaskOptions:
    rng = np.random.default_rng(0)
    mazes = tuple(generate("dfs", _SIZE, rng, f"maze-{index}") for index in range(_NUM_MAZES))
    return TaskOptions(task="hierarchical", mazes=mazes, time_limit=_TIME_LIMIT, landmark_distance=3)


def _check_acting(name: str, agent_class: type[Agent], task: Task, checkpoint: pathlib.Path | None) -> None:
    interface, episodes = task.interface, _Episodes(task, agent_class.needs_truth)

    def build() -> CheckedAgent:
        with calling(name, "build"):
            return CheckedAgent(name, agent_class.build(interface, checkpoint=checkpoint), interface.actions)

    def by_turns() -> dict[int, list[Any]]:
        agent, actions = build(), dict[int, list[Any]]()
        batches = episodes.steps(agent, _ORDER, actions), episodes.steps(agent, _ORDER[::-1], {})
        for _ in itertools.zip_longest(*batches):
            pass
        return actions

    expected = episodes.play(build(), _ORDER)
    own_slot = "let an action depend on nothing but the inputs and the state of its own slot"
    for when, found, advice in (
        (
            "when built anew from the same seed",
            episodes.play(build(), _ORDER),
            "make weights in build() from its seed, and draw random numbers only from generators made of inputs.seed",
        ),
        (
            "when another batch is played by turns",
            by_turns(),
            "keep all memory, generators too, in the state that act() returns, and nothing on self",
        ),
        (
            "after another episode",
            episodes.play(build(), [numbers[::-1] for numbers in _ORDER]),
            "begin anew where inputs.new_episode is set",
        ),
        ("in another slot of the batch", episodes.play(build(), _ORDER[::-1]), own_slot),
        ("alone", episodes.play(build(), _ORDER[:1]), own_slot),
    ):
        if found != {number: expected[number] for number in found}:
            same = f"expected the same actions in an episode {when}, found others"
            raise ConformanceError(f"agent {name!r}: {same}; {advice}")


class _Episodes:
    """The episodes that an agent is checked in."""

    def __init__(self, task: Task, needs_truth: bool):
        rng = np.random.default_rng(0)
        self._task, self._needs_truth = task, needs_truth
        self._episodes = [sample_episode(task, rng) for _ in itertools.chain(*_ORDER)]

    def play(self, agent: CheckedAgent, order: Sequence[Sequence[int]]) -> dict[int, list[Any]]:
        """Returns the agent's actions by episode; `order` has the episodes of each slot."""
        actions: dict[int, list[Any]] = {}
        for _ in self.steps(agent, order, actions):
            pass
        return actions

    def steps(
        self, agent: CheckedAgent, order: Sequence[Sequence[int]], actions: dict[int, list[Any]]
    ) -> Iterator[None]:
        """As `play`, but yields after each step, and adds to `actions`."""
        running: list[int | None] = [None] * len(order)  # the episode in each slot
        waiting = [list(numbers) for numbers in order]

        def next_episode(slot: int) -> Episode | None:
            running[slot] = waiting[slot].pop(0) if waiting[slot] else None
            number = running[slot]
            return None if number is None else self._episodes[number]

        env = MazeVectorEnv(
            self._task, len(order), num_threads=1, episode_source=next_episode, autoreset_mode="Disabled"
        )
        with contextlib.closing(env):
            observation, info = env.reset()
            new_episode = np.ones(len(order), dtype=bool)
            state = agent.initial_state(len(order))
            while any(number is not None for number in running):
                truth = None
                if self._needs_truth:
                    truth = true_state(self._task, env.episodes, info["position"], info["yaw"])
                seed = np.array([agent_seed(0, number or 0) for number in running])
                inputs = Inputs(observation, new_episode, info["is_first"], seed, truth)

                before = pickle.dumps(inputs)
                taken, state = agent.act(inputs, state)
                if pickle.dumps(inputs) != before:
                    raise ConformanceError(f"agent {agent.name!r}: expected act() to leave its inputs; change a copy")

                for number, action in zip(running, taken.tolist(), strict=True):
                    if number is not None:
                        actions.setdefault(number, []).append(action)
                observation, _, terminated, truncated, info = env.step(taken)
                # Of episodes side by side, each is cut at another step; a slot without one rests.
                is_long = [
                    number is not None and steps >= _NUM_STEPS + number
                    for number, steps in zip(running, info["steps"].tolist(), strict=True)
                ]
                ended = terminated | truncated | is_long
                if ended.any():
                    observation, info = env.reset(options={"reset_mask": ended})
                new_episode = ended & [number is not None for number in running]
                yield
