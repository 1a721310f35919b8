"""Trainings that differ in their seeds, one after another here, or each as a task of an executor on a shared folder."""

from __future__ import annotations

import concurrent.futures
import logging
import os
import pathlib
import platform
from collections.abc import Mapping

from mazebench import stopping
from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError, RunError, describe_error
from mazebench.evaluation.nodes import Common, check_node, common_of
from mazebench.evaluation.pool import PATIENCE, plain
from mazebench.storage.files import make_folder
from mazebench.tasks.task_options import TaskOptions
from mazebench.training.loop import Progress, run_training
from mazebench.training.run_folder import checkpoints
from mazebench.training.train_options import TrainOptions

_logger = logging.getLogger("mazebench.training")


def train_seeds(
    options: TrainOptions,
    asked: TaskOptions,
    folders: Mapping[int, pathlib.Path],
    resume: bool = False,
    executor: concurrent.futures.Executor | None = None,
    progress: Progress = lambda status: None,
) -> None:
    """Trains an agent once for each seed, into the folder of the seed, as `mazebench.training.loop.run_training` does.

    Args:
      options: of all trainings, but for the seed.
      asked: the task.
      folders: a run folder for each seed.
      resume: go on from the last checkpoints.
      executor: runs each training as a task, which goes on from its last checkpoint if it is run again. All nodes must
        have the working folder and the run folders.
      progress: called with the status after each step in this process.

    Raises:
      InputError: if an option is wrong, a folder can't be used, or a node has other versions or code.
      RunError: if a training failed. With an executor, the others are ended first.
    """
    if options.env_steps is None or options.minutes is not None:
        raise InputError("expected --env-steps and no --minutes with --seeds, so that all runs are equally long")
    folders = {seed: folder.absolute() for seed, folder in folders.items()}
    for folder in folders.values():
        if checkpoints(folder) and not resume:
            raise InputError(f"{folder}: holds a run already; go on with --resume or name another folder")
    if executor is None:
        for seed, folder in folders.items():
            run_training(options.replace(seed=seed), asked, folder, resume, progress)
        return

    common, waiting = common_of(options.agent, load_agent_class(options.agent)), {}
    for seed, folder in folders.items():
        make_folder(folder.parent)
        waiting[executor.submit(_train_on_node, common, options.replace(seed=seed), asked, folder)] = seed
    fault: InputError | RunError | None = None
    while waiting:
        stopping.check()
        for future in concurrent.futures.wait(waiting, PATIENCE, concurrent.futures.FIRST_COMPLETED).done:
            seed, lost = waiting.pop(future), future.exception()
            error = RunError(f"it was lost: {describe_error(lost)}; go on with --resume") if lost else future.result()
            fault = fault or error
            _logger.info("seed %d: %s; %d left", seed, error or f"has ended, in {folders[seed]}", len(waiting))
    if fault is not None:
        raise fault


def _train_on_node(
    common: Common, options: TrainOptions, asked: TaskOptions, folder: pathlib.Path
) -> InputError | RunError | None:
    """Trains, from the last checkpoint if the task was begun on a node that was lost; returns what ended it early."""
    try:
        for shared in (common.working_folder, str(folder.parent)):
            if not os.path.isdir(shared):
                raise InputError(f"node {platform.node()}: expected the folder {shared}, which nodes share, found none")
        os.chdir(common.working_folder)  # for mazes by their paths
        check_node(common)
        run_training(options, asked, folder, resume=True)
    except (InputError, RunError) as error:
        return plain(error)
    return None
