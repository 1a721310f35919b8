"""Collects demonstrations of an agent as a Minari data set.

Episode i is the one that `reset(seed=SEED + i)` of an environment of the task begins. docs/imitation.md lists the
arrays; those that are privileged are for training.
"""

from __future__ import annotations

import pathlib
import re
import shutil
from collections.abc import Callable
from typing import Any

import numpy as np

from mazebench import __version__
from mazebench.agent import Observation
from mazebench.envs.env_spec import env_spec_of
from mazebench.envs.spaces import action_space, observation_space
from mazebench.errors import InputError, remark
from mazebench.evaluation.chunk import Result, run_trials
from mazebench.evaluation.eval_options import NUM_ENVS, EvalOptions
from mazebench.evaluation.plan import Plan, build_agent, make_plan
from mazebench.storage.files import writing_to
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.rules import reward
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.trials import Trial

try:
    import minari
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage
except ModuleNotFoundError as error:
    raise InputError("mazebench collect needs Minari, which the extra [minari] brings (docs/start.md)") from error


def collect_demonstrations(
    options: EvalOptions,
    num_episodes: int,
    folder: pathlib.Path,
    *,
    num_envs: int = NUM_ENVS,
    progress: Callable[[int, int], None] = lambda ended, of: None,
) -> None:
    """Writes demonstrations of an agent as the data set `folder`, all or nothing.

    Args:
      options: the agent, the task, and the seed of the first episode.
      num_episodes: how many.
      folder: a new or an empty one.
      num_envs: environments side by side, at most.
      progress: called as episodes end, with their number and that of all.

    Raises:
      InputError: if an option can't be met, the mazes are those of the split eval, or `folder` is not empty or can't be
        written.
      RunError: if the agent failed.
    """
    if options.task.split == "eval":
        raise InputError("expected split 'train' or 'dev' to collect from, found 'eval', whose mazes are for results")
    temporary = folder.absolute().with_name(folder.name + ".tmp")  # Minari can't make it at a relative path
    with writing_to(folder):
        if folder.exists() and (found := sorted(path.name for path in folder.iterdir())):
            raise InputError(f"{folder}: expected a new or an empty folder, found {found[0]!r} in it")
        plan = make_plan(options, trials=(), resolver=resolve)
        if plan.remark:
            remark(plan.remark)
        shutil.rmtree(temporary, ignore_errors=True)
        try:
            # The observations of the data set have no context: it is in the infos, once for each leg.
            task, space = plan.task, observation_space(plan.task)
            del space.spaces["context"]
            storage = MinariStorage.new(
                temporary,
                observation_space=space,
                action_space=action_space(task),
                env_spec=env_spec_of(task),
                jpeg_encoding=False,  # which would change pictures
            )
            storage.update_metadata(
                {
                    "dataset_id": "mazebench/{}-v0".format(
                        re.sub(r"[^-\w]", "-", f"{task.options.slug}-{options.agent}")
                    ),
                    "minari_version": minari.__version__,
                    "algorithm_name": options.agent,
                    "description": f"{task}, driven by {options.agent}",
                    "requirements": [f"mazebench-mujoco=={__version__}"],
                }
            )
            storage.update_episodes(_play(plan, num_episodes, num_envs, progress))
            temporary.rename(folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def _play(plan: Plan, num_episodes: int, num_envs: int, progress: Callable[[int, int], None]) -> list[EpisodeBuffer]:
    """Returns the episodes, each under its seed; calls `progress` as they end."""
    task, seed = plan.task, plan.options.seed
    trials = {}
    for number in range(seed, seed + num_episodes):
        episode = sample_episode(task, np.random.default_rng(number))
        distance = task.mazes[episode.maze].distance(episode.start, episode.goal)
        # Nothing is measured by the shortest path, which only orders the episodes: the way from cell to cell will do.
        trials[number] = Trial(episode, distance, shortest_path=distance * task.cell_size)
    agent, truth = build_agent(plan.options, plan.task, plan.agent_class), plan.agent_class.needs_truth
    played: dict[int, EpisodeBuffer] = {}
    for results in run_trials(agent, task, trials, num_envs, seed=seed, needs_truth=truth, keep=_moments):
        played |= {result.number: _demonstration(task, trials[result.number], result) for result in results}
        progress(len(played), num_episodes)
    return [played[number] for number in trials]


def _moments(observation: Observation, info: dict[str, Any], actions: np.ndarray | None) -> list[dict[str, Any]]:
    """Returns what is observed, done and true in each environment; a context only where it is new."""
    pose = np.column_stack([info["position"], info["yaw"]])
    return [
        {
            "observed": {name: values[slot] for name, values in observation.items() if name != "context"},
            "context": [observation["context"][slot].copy()] if info["is_first"][slot] else [],
            "leg": info["landmark"][slot],
            "pose": pose[slot],
            "action": [] if actions is None else [actions[slot]],
        }
        for slot in range(len(pose))
    ]


def _demonstration(task: Task, trial: Trial, result: Result) -> EpisodeBuffer:
    """Returns an episode of which `_moments` were kept."""
    moments, maze = result.kept, task.mazes[trial.episode.maze]
    is_last = np.arange(result.steps) == result.steps - 1
    terminations, truncations = is_last & result.success, is_last & (not result.success)
    pose = np.stack([moment["pose"] for moment in moments])
    way_left = maze.distances(trial.episode.goal).ravel()[maze.cell_index(pose[:, :2])]
    return EpisodeBuffer(
        seed=result.number,
        options={"maze": maze.name, "distance": trial.distance},
        observations={name: np.stack([each["observed"][name] for each in moments]) for name in moments[0]["observed"]},
        actions=np.stack([action for moment in moments for action in moment["action"]]),
        rewards=reward(terminations).astype(np.float32),
        terminations=terminations,
        truncations=truncations,
        infos={
            "context": np.stack([context for moment in moments for context in moment["context"]]),
            "leg": np.array([moment["leg"] for moment in moments], dtype=np.int32),
            "privileged": {"pose": pose, "way_left": way_left},
        },
    )
