"""Collects demonstrations of an agent as a Minari data set.

Episode i is the one that `reset(seed=SEED + i)` of an environment of the task begins. docs/imitation.md lists the
arrays; those that are privileged are for training.
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import io
import pathlib
import re
import shutil
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mazebench import __version__, stopping
from mazebench.agent import Observation
from mazebench.agent_loading import load_agent_class
from mazebench.envs.env_spec import env_spec_of
from mazebench.envs.spaces import action_space, observation_space
from mazebench.errors import InputError, RunError
from mazebench.evaluation.chunk import Result, run_trials
from mazebench.evaluation.eval_options import EvalOptions, RunOptions
from mazebench.evaluation.evaluate import cut
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.evaluation.pool import pool_of
from mazebench.results.naming import described, title_of
from mazebench.storage.files import open_whole, writing_to
from mazebench.tasks.episode import sample_episode, schedule_of
from mazebench.tasks.rules import reward
from mazebench.tasks.schedule import moved_along
from mazebench.tasks.sensors import WITHOUT_SENSORS
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.trials import Trial

try:
    import minari
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage
except ModuleNotFoundError as error:
    raise InputError("mazebench collect needs Minari, which the extra [minari] brings (docs/start.md)") from error

_DEFAULT_RUN = RunOptions()
_NUM_REFERENCE = 20  # episodes at most, in which the scores are measured that stand for 0 and 1


def collect_demonstrations(
    options: EvalOptions,
    num_episodes: int,
    folder: pathlib.Path,
    *,
    run: RunOptions = _DEFAULT_RUN,
    context_per_step: bool = False,
    progress: Callable[[int, int], None] = lambda ended, of: None,
    executor: concurrent.futures.Executor | None = None,
) -> None:
    """Writes demonstrations of an agent as the data set `folder`, all or nothing.

    Args:
      options: the agent, the task, and the seed of the first episode.
      num_episodes: how many.
      folder: a new or an empty one.
      run: how; nothing is resumed.
      context_per_step: whether each observation has its context; else the infos have each context once.
      progress: called as episodes end, with their number and that of all.
      executor: plays the episodes, as in `mazebench.evaluation.evaluate.evaluate`.

    Raises:
      InputError: if an option can't be met, the mazes are those of the split eval, or `folder` is not empty or can't be
        written.
      RunError: if the agent failed, or the disk is full in the end.
    """
    if options.task.split == "eval":
        raise InputError("expected split 'train' or 'dev' to collect from, found 'eval', whose mazes are for results")
    if options.task.num_goals > 1:
        raise InputError(f"expected episodes of one goal to collect, found num_goals {options.task.num_goals}")
    folder = folder.absolute()  # Minari can't make one at a relative path
    temporary = folder.with_name(folder.name + ".tmp")
    with writing_to(folder):
        if folder.exists() and (found := sorted(path.name for path in folder.iterdir())):
            raise InputError(f"{folder}: expected a new or an empty folder, found {found[0]!r} in it")
        plan = make_plan(options, trials=(), resolver=resolve)
        plan.check_spread(run.workers, machines=run.cluster is not None or executor is not None)
        plan.say_remarks()
        shutil.rmtree(temporary, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        try:
            task, space = plan.task, observation_space(plan.task)
            if not context_per_step:
                del space.spaces["context"]
            storage = MinariStorage.new(
                temporary,
                observation_space=space,
                action_space=action_space(task),
                env_spec=env_spec_of(task),
                jpeg_encoding=False,  # which would change pictures
            )
            trials = _trials_of(plan, num_episodes)
            plan = dataclasses.replace(plan, trials=trials)  # type: ignore[arg-type]  # by number is as good
            episodes = _play(plan, trials, run, progress, executor)
            metadata = _reference_scores(task, dict(list(trials.items())[:_NUM_REFERENCE]), options.seed)
            strengths = task.options.active_perturbations
            name = title_of(task.options) if task.options.track else f"{task.options.task}-{task.size}"
            name += "".join(f"-{each.rpartition('_')[2]}-{value:g}" for each, value in strengths)
            metadata |= {
                "dataset_id": "mazebench/{}-v0".format(re.sub(r"[^-\w]", "-", f"{name}-{options.agent}")),
                "minari_version": minari.__version__,
                "algorithm_name": options.agent,
                "description": f"{described(task.options)}, driven by {options.agent}",
                "requirements": [f"mazebench-mujoco=={__version__}"],
            }

            # HDF5 fills a file in memory: on a full disk it would end the process.
            path, content = storage._file_path, io.BytesIO()
            storage._file_path = content
            try:
                storage.update_episodes(_with_contexts(each) if context_per_step else each for each in episodes)
                with open_whole(path) as file:
                    file.write(content.getbuffer())
                storage.update_metadata(metadata | {"dataset_size": storage.get_size()})
                stopping.finish()
                temporary.rename(folder)
            except OSError as error:
                raise RunError(f"{folder}: can't write there: {error.strerror}; nothing is kept") from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def _trials_of(plan: Plan, num_episodes: int) -> dict[int, Trial]:
    """Returns the episodes to play by their seeds."""
    task, seed, trials = plan.task, plan.options.seed, {}
    for number in range(seed, seed + num_episodes):
        episode = sample_episode(task, np.random.default_rng(number))
        distance = task.mazes[episode.maze].distance(episode.start, episode.goal)
        # Nothing is measured by the shortest path, which only orders the episodes: the way from cell to cell will do.
        trials[number] = Trial(episode, distance, shortest_path=distance * task.cell_size)
    return trials


def _play(
    plan: Plan,
    trials: Mapping[int, Trial],
    run: RunOptions,
    progress: Callable[[int, int], None],
    executor: concurrent.futures.Executor | None,
) -> list[EpisodeBuffer]:
    """Returns the episodes of a plan; calls `progress` as they end."""
    played: dict[int, EpisodeBuffer] = {}
    with pool_of(run, executor) as pool:
        chunks = cut(list(trials), pool, run.num_envs, keep=_moments)
        for ended in pool.run((None, plan, chunk) for chunk in chunks):
            for result in ended.get(None, []):
                played[result.number] = _demonstration(plan.task, trials[result.number], result)
            progress(len(played), len(trials))
    return [played[number] for number in trials]


def _reference_scores(task: Task, trials: Mapping[int, Trial], seed: int) -> dict[str, Any]:
    """Returns the mean returns of `random` and `oracle` in some trials, which Minari's normalized score has as 0, 1."""
    scores = {}
    for name, agent_name, actions in (("ref_min_score", "random", task.actions), ("ref_max_score", "oracle", "six")):
        played = task.replace(actions=actions, **WITHOUT_SENSORS)  # neither observes anything
        agent_class = load_agent_class(agent_name)
        agent = agent_class.build(played.interface, seed=seed)
        results = run_trials(agent, played, trials, len(trials), seed=seed, needs_truth=agent_class.needs_truth)
        scores[name] = float(np.mean([each.success - each.steps for several in results for each in several]))
    return scores


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
    privileged = {"pose": pose, "way_left": maze.distances(trial.episode.goal).ravel()[maze.cell_index(pose[:, :2])]}
    if (schedule := schedule_of(task, trial.episode)) is not None:
        sets = moved_along(schedule, pose[:, :2].tolist())
        privileged["moved_doors"] = np.array(sets, dtype=np.int64)
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
            "privileged": privileged,
        },
    )


def _with_contexts(episode: EpisodeBuffer) -> EpisodeBuffer:
    """Returns an episode whose observations have their contexts, instead of its infos."""
    infos = dict(episode.infos or {})
    observations = {**episode.observations, "context": infos.pop("context")[infos["leg"]]}
    return dataclasses.replace(episode, observations=observations, infos=infos)
