"""Conformance checks for other people's agents and environments, to call in their tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from mazebench.agent import Agent, Interface

_NUM_STEPS = 5
_BATCH_SIZE = 3


class ConformanceError(AssertionError):
    """An object breaks a contract; the message says which, what was expected and what was found."""


def check_agent(agent_class: type[Agent], interface: Interface | None = None, checkpoint: Any = None) -> None:
    """Builds an agent and lets it act on made-up observations of a batch of three environments.

    Checks that `build` gives an agent; that `act` returns actions `[B]` of an integer type in range, and a state; that
    it leaves its observation as it was; and that an agent built anew with the same seed acts the same.

    Args:
      agent_class: the class that an entry point of `mazebench.agents` names.
      interface: what it is built for; by default local navigation in 13 x 13 mazes.
      checkpoint: passed on to `build`.

    Raises:
      ConformanceError: at the first thing that is wrong.
    """
    if interface is None:
        wanted = getattr(agent_class, "context_size", lambda size: size)(13)
        interface = Interface("local", 13, wanted)
    for method in ("build", "initial_state", "act"):
        _require(callable(getattr(agent_class, method, None)), f"expected a class with {method}(), found none")
    first = _act_a_while(agent_class, interface, checkpoint)
    second = _act_a_while(agent_class, interface, checkpoint)
    _require(np.array_equal(first, second), "expected the same actions from the same seed, found others")


def _act_a_while(agent_class: type[Agent], interface: Interface, checkpoint: Any) -> np.ndarray:
    agent = agent_class.build(interface, seed=0, checkpoint=checkpoint)
    state = agent.initial_state(_BATCH_SIZE)
    rng = np.random.default_rng(0)
    is_first = np.ones(_BATCH_SIZE, dtype=bool)
    context = _made_up_context(interface)
    taken = []
    for step in range(_NUM_STEPS):
        if step == 0 and hasattr(agent, "seed_episodes"):
            agent.seed_episodes(np.arange(_BATCH_SIZE), is_first)
        observation = {"state": _made_up_states(interface, rng), "context": context.copy()}
        before = {key: value.copy() for key, value in observation.items()}
        result = agent.act(observation, is_first, state)
        _require(
            isinstance(result, tuple) and len(result) == 2,
            f"expected act() to return (actions, state), found {result!r}",
        )
        actions, state = np.asarray(result[0]), result[1]
        _check_actions(actions, interface)
        for key, value in before.items():
            _require(np.array_equal(observation[key], value), f"expected act() to leave observation[{key!r}] as it was")
        taken.append(actions)
        is_first = np.zeros(_BATCH_SIZE, dtype=bool)
    return np.stack(taken)


def _check_actions(actions: np.ndarray, interface: Interface) -> None:
    _require(actions.shape == (_BATCH_SIZE,), f"expected actions of shape ({_BATCH_SIZE},), found {actions.shape}")
    _require(np.issubdtype(actions.dtype, np.integer), f"expected integer actions, found {actions.dtype}")
    in_range = (actions >= 0) & (actions < interface.num_actions)
    _require(bool(in_range.all()), f"expected actions from 0 to {interface.num_actions - 1}, found {actions}")


def _made_up_context(interface: Interface) -> np.ndarray:
    """`[B, 4, M, M]`: an open field, start and goal in opposite corners."""
    size = interface.context_size
    context = np.zeros((_BATCH_SIZE, 4, size, size), dtype=np.float32)
    context[:, :2, [0, -1]] = context[:, :2, :, [0, -1]] = 1
    context[:, 2, -2, 1] = context[:, 3, 1, -2] = 1
    return context


def _made_up_states(interface: Interface, rng: np.random.Generator) -> np.ndarray:
    """`[B, 12]`: bodies somewhere inside."""
    states = np.zeros((_BATCH_SIZE, 12), dtype=np.float32)
    states[:, :2] = rng.uniform(1.2, interface.size - 1.2, size=(_BATCH_SIZE, 2))
    states[:, 2] = 0.28
    states[:, 5] = rng.uniform(-np.pi, np.pi, size=_BATCH_SIZE)
    return states


def check_environment(environment: Any, num_episodes: int = 2, max_steps: int = 2000) -> None:
    """Plays random episodes of a dm_env environment and checks that it keeps the navigation task's contract.

    Checks observations (`state` `[12]`, `context` `[4, M, M]` float32, constant between `is_first`), rewards (-1, and 0
    only at the goal), discounts (0 at the goal, else 1) and that every episode ends.

    Raises:
      ConformanceError: at the first thing that is wrong.
    """
    rng = np.random.default_rng(0)
    num_actions = environment.action_spec().num_values
    for _ in range(num_episodes):
        time_step = environment.reset()
        _require(time_step.first(), f"expected reset() to return a FIRST time step, found {time_step.step_type!r}")
        context = _check_observation(time_step.observation)
        for _ in range(max_steps):
            time_step = environment.step(int(rng.integers(num_actions)))
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
