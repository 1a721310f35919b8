"""Conformance checks for other people's agents and environments, to call in their tests."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from dm_env import specs

from mazebench.agent import Agent, Inputs, Interface, SingleAgent
from mazebench.agent_loading import checked_agent_class, load_agent_class
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.evaluation.agent_inputs import agent_seed, true_state
from mazebench.evaluation.checked_agent import AgentError, CheckedAgent, calling, context_size_of
from mazebench.maps.kinds import generate
from mazebench.tasks.build import make_spec
from mazebench.tasks.episode import Episode, sample_episode

_SIZE = 7
_NUM_MAZES = 3  # of different paths between their corners, so that episodes side by side end at different steps
_TIME_LIMIT = 5  # steps a leg: whatever an agent does, all landmarks come up
_ORDER = ((0, 3), (1, 4), (2, 5))  # the episodes' numbers in three slots, each slot's one after another


class ConformanceError(AssertionError):
    """An object breaks a contract; the message says which, what was expected and what was found."""


def check_agent(
    agent_class: type[Agent] | type[SingleAgent] | str, interface: Interface | None = None, checkpoint: Any = None
) -> None:
    """Builds an agent and lets it act in a few short episodes with landmarks, as an evaluation would.

    Checks the class, that every answer is an action for each environment and a state, and that the agent leaves its
    inputs as they are. Then the same episodes are played again: by an agent built anew, by one agent in two batches by
    turns, in another order, in other slots, and one at a time. The actions in an episode must be the same each time.

    Args:
      agent_class: the class, or what `--agent` takes.
      interface: what the agent is built for; by default hierarchical navigation in 7 x 7 mazes with
        the sensors that it needs.
      checkpoint: passed on to `build`.

    Raises:
      ConformanceError: at the first thing that is wrong.
      InputError: if no agent has the given name, or the agent can't use the checkpoint.
    """
    if isinstance(agent_class, str):
        agent_class = load_agent_class(agent_class)
    try:
        checked = checked_agent_class(getattr(agent_class, "__name__", repr(agent_class)), agent_class)
    except InputError as error:
        raise ConformanceError(str(error)) from error
    try:
        _check_acting(_Trial(checked, interface, checkpoint))
    except AgentError as error:
        raise ConformanceError(str(error)) from error


def _check_acting(trial: _Trial) -> None:
    expected = trial.play(_ORDER)

    def check(when: str, found: dict[int, list[int]], advice: str) -> None:
        same = f"expected the same actions in an episode {when}, found others"
        wanted = {number: expected[number] for number in found}
        _require(found == wanted, f"agent {trial.name!r}: {same}; {advice}")

    check(
        "when built anew from the same seed",
        trial.play(_ORDER),
        "make weights in build() from its seed, and draw random numbers only from generators made of inputs.seed",
    )
    check(
        "when another batch is played by turns",
        trial.play_by_turns(),
        "keep all memory, generators too, in the state that act() returns, and nothing on self",
    )
    check(
        "after another episode",
        trial.play([numbers[::-1] for numbers in _ORDER]),
        "begin anew where inputs.new_episode is set",
    )
    own_slot = "let an action depend on nothing but the inputs and the state of its own slot"
    check("in another slot of the batch", trial.play(_ORDER[::-1]), own_slot)
    check("alone", trial.play(_ORDER[:1]), own_slot)


class _Trial:
    """The episodes that an agent is checked in."""

    def __init__(self, agent_class: type[Agent], interface: Interface | None, checkpoint: Any):
        self.name = agent_class.__name__
        self._agent_class, self._checkpoint = agent_class, checkpoint
        if interface is None:
            interface = Interface(
                task="hierarchical",
                size=_SIZE,
                context_size=context_size_of(self.name, agent_class, _SIZE),
                sensors=agent_class.needs_sensors,
            )
        self._interface = interface

        rng = np.random.default_rng(0)
        drawn = (generate("dfs", interface.size, rng, f"maze-{index}") for index in range(_NUM_MAZES))
        mazes = tuple(dataclasses.replace(maze, cell_size=interface.cell_size) for maze in drawn)
        self._task_spec = make_spec(
            "hierarchical",
            maps=mazes,
            time_limit=_TIME_LIMIT,
            landmark_distance=3,
            context_size=interface.context_size,
            sensors=interface.sensors,
        )
        self._episodes = [sample_episode(self._task_spec, rng) for _ in itertools.chain(*_ORDER)]

    def play(self, order: Sequence[Sequence[int]]) -> dict[int, list[int]]:
        """Returns the actions of a newly built agent by episode; `order` has the episodes of each slot."""
        actions: dict[int, list[int]] = {}
        for _ in self._steps(self._build(), order, actions):
            pass
        return actions

    def play_by_turns(self) -> dict[int, list[int]]:
        """As `play`, where the agent plays another batch of episodes at the same time, a step in each by turns."""
        agent = self._build()
        actions: dict[int, list[int]] = {}
        for _ in itertools.zip_longest(self._steps(agent, _ORDER, actions), self._steps(agent, _ORDER[::-1], {})):
            pass
        return actions

    def _build(self) -> CheckedAgent:
        with calling(self.name, "build"):
            agent = self._agent_class.build(self._interface, seed=0, checkpoint=self._checkpoint)
        _require(
            isinstance(agent, Agent),
            f"agent {self.name!r}: expected build() to return an agent, found {type(agent).__name__}",
        )
        return CheckedAgent(self.name, agent, self._interface.num_actions)

    def _steps(self, agent: Agent, order: Sequence[Sequence[int]], actions: dict[int, list[int]]) -> Iterator[None]:
        """Plays the episodes of each slot and adds to the `actions` of each; yields after each step."""
        num_slots = len(order)
        waiting = [list(numbers) for numbers in order]
        running: list[int | None] = [None] * num_slots

        def next_episode(slot: int) -> Episode | None:
            running[slot] = number = waiting[slot].pop(0) if waiting[slot] else None
            return None if number is None else self._episodes[number]

        env = MazeVectorEnv(self._task_spec, num_slots, num_threads=1, episode_source=next_episode)
        with contextlib.closing(env):
            observation, info = env.reset()
            new_episode = np.ones(num_slots, dtype=bool)
            state = agent.initial_state(num_slots)
            while any(number is not None for number in running):
                truth = None
                if self._agent_class.needs_truth:
                    truth = true_state(self._task_spec, env.episodes, info["position"], info["yaw"])
                inputs = Inputs(
                    observation=observation,
                    new_episode=new_episode,
                    new_context=info["is_first"],
                    seed=np.array([agent_seed(0, number or 0) for number in running]),
                    truth=truth,
                )

                # Let the agent act, and check that it changed none of its inputs.
                before = _arrays(inputs)
                taken, state = agent.act(inputs, state)
                for name, array in _arrays(inputs).items():
                    _require(
                        np.array_equal(array, before[name]),
                        f"agent {self.name!r}: expected act() to leave inputs.{name} as it was; change a copy",
                    )

                for number, action in zip(running, taken.tolist(), strict=True):
                    if number is not None:
                        actions.setdefault(number, []).append(action)
                observation, _, terminated, truncated, info = env.step(taken)
                new_episode = (terminated | truncated) & [number is not None for number in running]
                yield


def _arrays(inputs: Inputs) -> dict[str, np.ndarray]:
    """Returns copies of all arrays of `inputs`, by the names that messages call them."""
    arrays = {f"observation[{name!r}]": values for name, values in inputs.observation.items()}
    arrays |= {name: getattr(inputs, name) for name in ("new_episode", "new_context", "seed")}
    if inputs.truth is not None:
        arrays |= {f"truth.{name}": values for name, values in inputs.truth._asdict().items()}
    return {name: np.array(values) for name, values in arrays.items()}


def check_environment(environment: Any, num_episodes: int = 2, max_steps: int = 2000) -> None:
    """Plays random episodes of a dm_env environment and checks that it keeps the navigation task's contract.

    Checks observations (`state` `[12]`, `context` `[4, M, M]` float32, constant between `is_first`), rewards (-1, and 0
    only at the goal), discounts (0 at the goal, else 1) and that every episode ends.

    Raises:
      ConformanceError: at the first thing that is wrong.
    """
    _require(
        hasattr(environment, "action_spec"),
        f"expected a dm_env environment, found {type(environment).__name__}; of Gymnasium's, "
        "gymnasium.utils.env_checker.check_env knows the rules",
    )
    rng = np.random.default_rng(0)
    action_spec = environment.action_spec()
    for _ in range(num_episodes):
        time_step = environment.reset()
        _require(time_step.first(), f"expected reset() to return a FIRST time step, found {time_step.step_type!r}")
        context = _check_observation(time_step.observation)
        for _ in range(max_steps):
            time_step = environment.step(_random_action(action_spec, rng))
            observed = _check_observation(time_step.observation)
            _require(
                np.array_equal(observed, context) or bool(time_step.observation.get("is_first", False)),
                "expected the context to stay the same until is_first, found another",
            )
            context = observed
            _check_outcome(time_step)
            if time_step.last():
                break
        else:
            raise ConformanceError(f"expected the episode to end within {max_steps} steps, found it going on")


def _random_action(spec: specs.Array, rng: np.random.Generator) -> Any:
    if isinstance(spec, specs.DiscreteArray):
        return int(rng.integers(spec.num_values))
    return rng.uniform(spec.minimum, spec.maximum, size=spec.shape).astype(spec.dtype)


def _check_observation(observation: dict[str, np.ndarray]) -> np.ndarray:
    state, context = observation["state"], observation["context"]
    _require(
        state.shape == (12,) and state.dtype == np.float32,
        f"expected a state of 12 float32, found {state.shape} {state.dtype}",
    )
    _require(
        context.ndim == 3 and context.shape[0] == 4 and context.dtype == np.float32,
        f"expected a context of shape (4, M, M) float32, found {context.shape} {context.dtype}",
    )
    _require(bool(np.isfinite(state).all()), f"expected a finite state, found {state}")
    return context


def _check_outcome(time_step: Any) -> None:
    reached = bool(time_step.last() and time_step.discount == 0.0)
    reward, discount = (0.0, 0.0) if reached else (-1.0, 1.0)
    _require(time_step.reward == reward, f"expected reward {reward}, found {time_step.reward}")
    _require(time_step.discount == discount, f"expected discount {discount}, found {time_step.discount}")


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ConformanceError(message)
