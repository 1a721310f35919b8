"""The speed of acting and of an update, divided into their parts."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import torch

from mazebench.agent import Agent, Interface
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.registry import make_spec
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Collector

from ..common import kernels
from .learner import MuZeroLearner

_NUM_ACTORS = 256


def update_table(seconds: float, build_learner: Callable[..., MuZeroLearner]) -> dict[str, list[dict[str, Any]]]:
    """Returns the milliseconds that each part of an update takes by title, once the replay holds enough to learn."""
    learner = build_learner(Interface("local", 13, 13), load_mazes(13, "train"))
    collector = Collector(TaskSpec(mazes=load_mazes(13, "train"), **learner.task_options()), learner.num_envs, 0)
    learner.actor.explore_from(0, learner.num_envs, seed=0)
    state = learner.actor.initial_state(learner.num_envs)
    while not learner.num_updates_due(10**9):
        experience, state = collector.play(learner.actor, state)
        learner.observe(experience)
    parts = {
        "sample": "sampling",
        "_pictured": "wrong maps, evidence",
        "_batch": "its tensors",
        "_targets": "targets",
        "_descend": "backward, optimizer",
    }
    with kernels.one_thread():
        return {"the parts of an update, one thread": _divided(learner, parts, learner.update, "losses", seconds)}


def acting_table(seconds: float, agent: Agent) -> dict[str, list[dict[str, Any]]]:
    """Returns the milliseconds that each part of acting takes by title, where doors have moved and there is a lidar."""
    task = make_spec("stale", level=(1,), sensors=("lidar",))
    collector, state = Collector(task, _NUM_ACTORS, 0), agent.initial_state(_NUM_ACTORS)

    def step() -> None:
        nonlocal state
        action, state = agent.act(collector.inputs, state)
        collector.step(action)

    parts = {"_note": "evidence", "_revise": "belief, hypermodel", "_chosen": "policy"}
    title = f"the parts of acting in {_NUM_ACTORS} mazes with a lidar, on maps with moved doors, one thread"
    return {title: _divided(agent, parts, step, "environments", seconds)}


def _divided(
    owner: Any, parts: dict[str, str], step: Callable[[], Any], rest: str, seconds: float
) -> list[dict[str, Any]]:
    """Returns the milliseconds of a `step` by part: `parts` names some methods of `owner`, `rest` what is left."""
    step()
    parts = {method: part for method, part in parts.items() if hasattr(owner, method)}
    times = dict.fromkeys(parts.values(), 0.0)
    for method, part in parts.items():
        setattr(owner, method, _timed(getattr(owner, method), times, part))
    count, begin = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - begin) < seconds:
        step()
        count += 1
    times[rest] = elapsed - sum(times.values())
    return [{"what": part, "ms": 1e3 * spent / count, "%": 100 * spent / elapsed} for part, spent in times.items()]


def _timed(function: Callable[..., Any], times: dict[str, float], part: str) -> Callable[..., Any]:
    """Returns `function`, which adds its running time to `times[part]`."""

    def timed(*arguments: Any) -> Any:
        begin = time.perf_counter()
        result = function(*arguments)
        if torch.cuda.is_available():
            torch.cuda.synchronize()
        times[part] += time.perf_counter() - begin
        return result

    return timed
