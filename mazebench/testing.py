"""Conformance checks for other people's agents and environments, to call in their tests."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
from dm_env import specs

from mazebench.agent import Agent, Interface, load_agent_class
from mazebench.evaluation.contract import AgentError, CheckedAgent, calling
from mazebench.tasks.context import default_context_size

_SIZE = 13
_NUM_STEPS = 5
_EPISODES = np.arange(3)  # by their seeds
_ADVICE = "begin anew where is_first is set, and draw an episode's random numbers by its seed, given to seed_episodes()"


class ConformanceError(AssertionError):
    """An object breaks a contract; the message says which, what was expected and what was found."""


def check_agent(agent_class: type[Agent] | str, interface: Interface | None = None, checkpoint: Any = None) -> None:
    """Builds an agent and lets it act on made-up observations, as an evaluation would.

    Checks that `build` gives an agent; that `act` returns actions `[B]` of an integer type in range, and a state, in
    three environments and in one; that it leaves what it is given as it was; and that what it does in an episode is
    the same when built anew with the same seed, after another episode, and in another slot of the batch. Else records
    would depend on how many environments and processes an evaluation has.

    Args:
      agent_class: the class that an entry point of `mazebench.agents` names, or what `--agent` takes.
      interface: what it is built for; by default local navigation in 13 x 13 mazes.
      checkpoint: passed on to `build`.

    Raises:
      ConformanceError: at the first thing that is wrong.
      InputError: the agent's own, of a checkpoint that it can't use.
    """
    if isinstance(agent_class, str):
        agent_class = load_agent_class(agent_class)
    _check_class(agent_class)
    try:
        interface = interface or _default_interface(agent_class)
        expected = _play(agent_class, interface, checkpoint, _EPISODES)
        for when, found in (
            ("when built anew from the same seed", _play(agent_class, interface, checkpoint, _EPISODES)),
            ("after another one", _play(agent_class, interface, checkpoint, _EPISODES, num_times=2)),
            ("in another slot", _play(agent_class, interface, checkpoint, _EPISODES[::-1])[:, ::-1]),
        ):
            _require(
                np.array_equal(expected, found),
                f"agent {agent_class.__name__!r}: expected the same actions in an episode {when}, found others; "
                + _ADVICE,
            )
        _play(agent_class, interface, checkpoint, _EPISODES[:1])
    except AgentError as error:
        raise ConformanceError(str(error)) from error


def _default_interface(agent_class: type[Agent]) -> Interface:
    with calling(agent_class.__name__, "context_size"):
        return Interface("local", _SIZE, int(getattr(agent_class, "context_size", default_context_size)(_SIZE)))


def _check_class(agent_class: Any) -> None:
    _require(isinstance(agent_class, type), f"expected a class, found {agent_class!r}")
    name = agent_class.__name__
    for method in ("build", "initial_state", "act"):
        _require(
            callable(getattr(agent_class, method, None)),
            f"agent {name!r}: expected a class with {method}(), found none",
        )
    is_method = inspect.isfunction(inspect.getattr_static(agent_class, "build"))
    _require(not is_method, f"agent {name!r}: expected build() to be a classmethod, found a method of its objects")


def _built(agent_class: type[Agent], interface: Interface, checkpoint: Any) -> CheckedAgent:
    name = agent_class.__name__
    with calling(name, "build"):
        agent = agent_class.build(interface, seed=0, checkpoint=checkpoint)
    for method in ("initial_state", "act"):
        _require(
            callable(getattr(agent, method, None)),
            f"agent {name!r}: expected build() to return an object with {method}(), found {type(agent).__name__}",
        )
    return CheckedAgent(name, agent, interface.num_actions)


def _play(
    agent_class: type[Agent], interface: Interface, checkpoint: Any, episodes: np.ndarray, num_times: int = 1
) -> np.ndarray:
    """`[steps, B]`: a new agent's actions in made-up episodes side by side, played so many times; those of the last."""
    agent = _built(agent_class, interface, checkpoint)
    state = agent.initial_state(len(episodes))
    states, context = _made_up_states(interface)[:, episodes], _made_up_context(interface)[episodes]
    taken = np.zeros(states.shape[:2], dtype=np.int64)
    for _ in range(num_times):
        for step in range(_NUM_STEPS):
            is_first = np.full(len(episodes), step == 0)
            if step == 0:
                agent.seed_episodes(episodes.copy(), is_first.copy())
            given = {"state": states[step].copy(), "context": context.copy(), "is_first": is_first.copy()}
            observation = {key: given[key] for key in ("state", "context")}
            taken[step], state = agent.act(observation, given["is_first"], state)
            for key, value in (("state", states[step]), ("context", context), ("is_first", is_first)):
                what = key if key == "is_first" else f"observation[{key!r}]"
                _require(
                    np.array_equal(given[key], value), f"agent {agent.name!r}: expected act() to leave {what} as it was"
                )
    return taken


def _made_up_context(interface: Interface) -> np.ndarray:
    """`[B, 4, M, M]`: open fields, the start in a corner, each goal in another place."""
    size = interface.context_size
    context = np.zeros((len(_EPISODES), 4, size, size), dtype=np.float32)
    context[:, :2, [0, -1]] = context[:, :2, :, [0, -1]] = 1
    context[:, 3, 1, -2] = 1
    context[_EPISODES, 2, -2, 1 + _EPISODES % (size - 2)] = 1
    return context


def _made_up_states(interface: Interface) -> np.ndarray:
    """`[steps, B, 12]`: bodies somewhere inside."""
    rng, shape = np.random.default_rng(0), (_NUM_STEPS, len(_EPISODES))
    states = np.zeros((*shape, 12), dtype=np.float32)
    states[..., :2] = rng.uniform(1.2, interface.size - 1.2, size=(*shape, 2))
    states[..., 2] = 0.28
    states[..., 5] = rng.uniform(-np.pi, np.pi, size=shape)
    return states


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
