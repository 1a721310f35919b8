"""Collects demonstrations of an agent, as files of arrays or as a Minari data set.

Episode i is the one that `reset(seed=SEED + i)` of an environment of the task begins. The folder gets `config.json`
and a file of arrays for each 50 episodes; a run that was stopped goes on after them. Minari's data set is made of these
files when all are there, and takes their place.
"""

from __future__ import annotations

import pathlib
from collections.abc import Callable

import numpy as np

from mazebench import stopping
from mazebench.agent import Agent
from mazebench.errors import InputError, remark
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.collect_options import MINARI, CollectOptions
from mazebench.evaluation.demonstrations import Demonstration, StepRecorder, make_demonstration, save_demonstrations
from mazebench.evaluation.eval_options import NUM_ENVS, EvalOptions
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.evaluation.store import is_begun
from mazebench.results.reading import CONFIG
from mazebench.storage.files import writing_to
from mazebench.storage.json_files import write_json
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.task import resolve
from mazebench.tasks.trials import Trial

EPISODES_PER_FILE = 50
DATASET = "data"  # the folder of Minari's data set, as Minari calls it


def collect_demonstrations(
    options: EvalOptions,
    wanted: CollectOptions,
    folder: pathlib.Path,
    *,
    resume: bool = False,
    num_envs: int = NUM_ENVS,
    progress: Callable[[int, int], None] = lambda ended, of: None,
) -> None:
    """Writes demonstrations of an agent into a folder.

    Args:
      options: the agent, the task, and the seed of the first episode.
      wanted: how many, and in which format.
      folder: a new or an empty one, or one to go on with.
      resume: whether to go on with the run that `folder` holds.
      num_envs: environments side by side, at most.
      progress: called as episodes end, with their number and that of all.

    Raises:
      InputError: if an option can't be met, the mazes are those of the split eval, or `folder` holds anything else.
      RunError: if the agent failed; the files that were written are kept.
    """
    if options.task.split == "eval":
        raise InputError("expected split 'train' or 'dev' to collect from, found 'eval', whose mazes are for results")
    plan = make_plan(options, trials=(), resolver=resolve)
    if plan.remark:
        remark(plan.remark)
    agent, count, file_format = plan.build_agent(), wanted.episodes, wanted.format_in_use
    identity = {name: value for name, value in plan.identity.items() if name != "episodes_per_distance"}
    identity |= {"episodes": count, "format": file_format}
    if not is_begun(folder, identity, resume):
        with writing_to(folder):
            write_json(folder / CONFIG, identity)

    files = _files(folder, count)
    is_whole = (folder / DATASET).exists()
    for path, numbers in files.items():
        if not is_whole and not path.exists():
            episodes = _play(plan, agent, numbers, num_envs, lambda number: progress(number, count))
            with writing_to(folder):
                save_demonstrations(path, episodes)
        progress(numbers.stop, count)
    if file_format == MINARI:
        from mazebench.evaluation.minari_data import write_dataset  # Minari is an extra

        if not is_whole:
            write_dataset(folder / DATASET, plan.task, options.agent, files)
        for path in files:
            path.unlink(missing_ok=True)


def num_kept(folder: pathlib.Path, count: int) -> int:
    """Returns how many of the `count` episodes of a run are in files."""
    is_whole = (folder / DATASET).exists()
    return sum(len(numbers) for path, numbers in _files(folder, count).items() if is_whole or path.exists())


def _files(folder: pathlib.Path, count: int) -> dict[pathlib.Path, range]:
    """Returns the files of `count` episodes, and the numbers of the episodes in each."""
    firsts = range(0, count, EPISODES_PER_FILE)
    return {
        folder / f"episodes-{first:06}.npz": range(first, min(first + EPISODES_PER_FILE, count)) for first in firsts
    }


def _play(
    plan: Plan, agent: Agent, numbers: range, num_envs: int, progress: Callable[[int], None]
) -> list[Demonstration]:
    """Returns the episodes of some numbers; calls `progress` with the number of the next one as episodes end."""
    task, seed = plan.task, plan.options.seed
    trials = []
    for number in numbers:
        episode = sample_episode(task, np.random.default_rng(seed + number))
        distance = task.mazes[episode.maze].distance(episode.start, episode.goal)
        # Nothing is measured by the shortest path, which only orders the episodes: the way from cell to cell will do.
        trials.append((seed + number, Trial(episode, distance, shortest_path=distance * task.cell_size)))
    played: dict[int, Demonstration] = {}
    for outcomes in run_trials(
        agent, task, trials, num_envs, seed=seed, needs_truth=plan.agent_class.needs_truth, recorder=StepRecorder()
    ):
        stopping.check()
        if outcomes:
            played |= {outcome.index: make_demonstration(task, outcome) for outcome in outcomes}
            progress(numbers.start + len(played))
    return [played[index] for index, _ in trials]
