"""The training loop: collects, learns at a fixed replay ratio, evaluates and saves checkpoints.

A milestone is a checkpoint with an evaluation, after every so many steps. Trajectories begin anew there, so a run that
is resumed from it goes on as the unbroken one did. A savepoint is a checkpoint between milestones. A run that saves it
goes on unchanged; a run that is resumed from it begins new trajectories there, and so differs from the unbroken one.
"""

from __future__ import annotations

import dataclasses
import functools
import logging
import math
import pathlib
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from mazebench import stopping
from mazebench.agent_loading import learning_agents, load_agent_class
from mazebench.errors import InputError, RunError, unknown
from mazebench.evaluation.checked_agent import context_size_of
from mazebench.evaluation.provenance import code_hash
from mazebench.maps.maze_options import DrawnOptions
from mazebench.options import fields_of, from_names
from mazebench.results.played import mazes_hash
from mazebench.tasks.build import build_task
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.task_options import TaskOptions, Variants
from mazebench.training.counters import Counters
from mazebench.training.experience import Experience
from mazebench.training.held_out import HeldOutEvaluation
from mazebench.training.protocol import Learner, LearningAgent
from mazebench.training.run_folder import RunFolder, read_counters
from mazebench.training.sources import InProcessSource, Source
from mazebench.training.status import Progress, Timer, in_words
from mazebench.training.train_options import TrainOptions

# As many steps take less than a minute on two cores. They are counted, not timed, so that the same run writes the same
# lines.
STEPS_BETWEEN_LINES = 5_000


_logger = logging.getLogger("mazebench.training")


class TrainingError(RunError):
    """A run can't go on; its checkpoints are intact."""


def train(
    options: TrainOptions, out: pathlib.Path, resume: bool = False, progress: Progress = lambda status: None
) -> None:
    """Trains an agent in the run folder `out`; from its last checkpoint if `resume`.

    The logger "mazebench.training" says what happens. In a block of `mazebench.stopping.stoppable` that waits, a signal
    saves a savepoint and ends the training. `progress` is called with the status after each step.

    Raises:
      InputError: if an option is wrong, or `out` can't be used.
      TrainingError: if a loss is not finite.
    """
    agent_class = load_agent_class(options.agent)
    if not issubclass(agent_class, LearningAgent):
        raise InputError(f"agent {options.agent!r} doesn't learn; agents that do: {', '.join(learning_agents())}")
    overrides = dict(options.overrides)
    task = _training_task(options, agent_class, agent_class.task_options(overrides))
    learner = agent_class.build_learner(task, seed=options.seed, overrides=overrides)
    held_out = HeldOutEvaluation(task, options.eval_mazes, options.task.distances)
    # The source comes first: if the cluster can't be reached, no run is begun.
    with open_source(options, task, learner) as source:
        folder = RunFolder(out)
        counters = _begin_or_resume(options, folder, learner, task, resume)
        if options.env_steps is not None and counters.env_steps >= options.env_steps and counters.is_milestone:
            _logger.info("%s: the run is finished, at %s steps", out, f"{counters.env_steps:,}")
            return
        if counters.env_steps:
            _logger.info("resuming %s at %s steps", out, f"{counters.env_steps:,}")
        elif resume:
            _logger.info("nothing to resume in %s; starting a new run", out)
        _logger.info("%s: %s", options.agent, learner.description())
        TrainingLoop(options, folder, learner, task, source, held_out, counters, progress).run()


@dataclasses.dataclass
class TrainingLoop:
    """Goes on from the checkpoint at the counters, with a learner that is as it was there."""

    _options: TrainOptions
    _folder: RunFolder
    _learner: Learner
    _task: TaskSpec
    _source: Source
    _held_out: HeldOutEvaluation
    _counters: Counters
    _progress: Progress

    def __post_init__(self) -> None:
        self._timer = Timer(self._options.minutes, self._options.env_steps, self._counters)
        self._saved_steps, self._saved_time = self._counters.env_steps, time.monotonic()

    def run(self) -> None:
        """Trains until the time or the steps are up; the last step is a milestone."""
        while True:
            self._train_until(self._counters.milestone_steps + self._options.checkpoint_steps)
            if not self._counters.is_milestone:
                self._reach_milestone()
            if self._is_over():
                return

    def _train_until(self, env_steps: int) -> None:
        # New trajectories, so that a run that is resumed from this milestone goes on as the unbroken one did.
        seeds = np.random.SeedSequence((self._options.seed, self._counters.env_steps))
        source = self._source.collect(int(seeds.generate_state(1)[0]))
        while self._counters.env_steps < env_steps and not self._is_over():
            line_steps = self._counters.logged_steps + STEPS_BETWEEN_LINES
            if line_steps <= self._counters.env_steps < env_steps - STEPS_BETWEEN_LINES // 2:  # a milestone has a line
                self._folder.log(self._counters, self._counters.mean_losses())
                self._counters = self._counters.after_line()
            self._learn_from(next(source))
            self._progress(self._timer.status(self._counters))
            if self._is_savepoint_due():
                self._save()
            stopping.check()

    def _learn_from(self, pieces: Sequence[tuple[int, Experience]]) -> None:
        """Stores experience, each piece with the index of its first environment, and makes the updates due."""
        for first_env, experience in pieces:
            self._learner.observe(experience, first_env)
            self._counters = self._counters.after_steps(len(experience.action))
        for _ in range(num_updates_due(self._learner, self._counters.env_steps) - self._counters.updates):
            self._update()

    def _update(self) -> None:
        losses = self._learner.update()
        self._counters = self._counters.after_update(losses)
        for name, value in losses.items():
            if not math.isfinite(value):
                last = self._folder.checkpoints()[-1]
                raise TrainingError(
                    f"{name} became {value} at update {self._counters.updates}; last good checkpoint: {last}"
                )

    def _is_over(self) -> bool:
        return self._timer.share_done(self._counters) >= 1.0

    def _is_savepoint_due(self) -> bool:
        seconds = 60 * self._options.checkpoint_minutes
        return seconds > 0 and (stopping.is_asked() or time.monotonic() >= self._saved_time + seconds)

    def _save(self) -> None:
        """Saves a checkpoint, unless the last one is of this very step: a source may have brought no experience."""
        if self._counters.env_steps != self._saved_steps:
            _save(self._options, self._folder, self._learner, self._task, self._counters)
        self._saved_steps, self._saved_time = self._counters.env_steps, time.monotonic()

    def _reach_milestone(self) -> None:
        """Saves, evaluates, and logs; a run that is stopped in the evaluation repeats it when it is resumed."""
        counters, status = self._counters, self._timer.status(self._counters)
        self._save()
        rates = self._held_out.success_rates(self._learner.actor, self._show_evaluation)
        metrics = counters.mean_losses() | {f"success_rate_{distance}": rate for distance, rate in rates.items()}
        self._folder.make_milestone(counters, metrics)
        self._counters = counters.at_milestone()
        _logger.info("%s: %s", status.summary, in_words(metrics))

    def _show_evaluation(self, ended: int, of: int) -> None:
        stopping.check()
        self._progress(self._timer.status(self._counters, evaluated=(ended, of)))


def num_updates_due(learner: Learner, env_steps: int) -> int:
    """Returns how many updates should have been made after `env_steps` agent steps; the replay ratio is fixed.

    They are one a `steps_per_update` steps after the first `min_rows`; 0 until as many rows are stored, as after a
    resume without the replay.
    """
    if learner.num_rows < learner.min_rows:
        return 0
    return max(0, env_steps - learner.min_rows) // learner.steps_per_update


def _training_task(options: TrainOptions, agent_class: type[LearningAgent], defaults: dict[str, Any]) -> TaskSpec:
    """Returns the task of `options`; `defaults` are the learner's, by name, for what the user left as it was."""
    if needed := [name for name in agent_class.needs_shown if name in options.task.hide]:
        raise InputError(f"agent {options.agent!r}: needs the {needed[0]}, found it hidden")
    of_task, of_variants = fields_of(TaskOptions), fields_of(Variants)
    for name in defaults:
        if name not in of_task and name not in of_variants:
            raise unknown("option of the learner's task", name, (*of_task, *of_variants))

    left = {name for name in of_task if getattr(options.task, name) == of_task[name].default}
    task = dataclasses.replace(options.task, **{name: defaults[name] for name in defaults if name in left})

    variants = {name: value for name, value in defaults.items() if name in of_variants}
    if options.pairs != of_variants["pairs"].default:
        variants["pairs"] = options.pairs
    if task.track is not None or variants.get("pairs") == "fixed":
        variants["num_goals"] = 1  # a track has one goal, and so has a maze with a fixed pair

    choose_context_size = functools.partial(context_size_of, options.agent, agent_class)
    chosen = from_names(Variants, variants)
    spec = build_task(task, options.maze_options, chosen, choose_context_size=choose_context_size)
    if spec.cell_size != 1:
        raise InputError(f"expected mazes with cells of 1 m in a training, found {spec.cell_size:g} m (--cell-size)")
    return spec


def open_source(options: TrainOptions, task: TaskSpec, learner: Learner) -> Source:
    """Returns where experience comes from: this process, or the workers of `options` on Ray.

    Raises:
      InputError: if workers are wanted, and Ray is not installed or its cluster can't be reached.
    """
    if not options.workers:
        return InProcessSource(task, learner.actor, learner.num_envs)
    from mazebench.training.distributed import RaySource

    return RaySource(task, learner, options.workers, options.ray_address)


def _begin_or_resume(
    options: TrainOptions, folder: RunFolder, learner: Learner, task: TaskSpec, resume: bool
) -> Counters:
    """Saves the first checkpoint of a new run, or loads the last one into `learner`; returns where the run is."""
    config = _origin(options, task) | {
        "checkpoint_steps": options.checkpoint_steps,
        "agent_config": learner.config(),
    }
    checkpoints = folder.checkpoints()
    if checkpoints and not resume:
        raise InputError(f"{folder.path}: holds a run already; go on with --resume or name another folder")
    folder.check_config(config)
    if not checkpoints:
        _save(options, folder, learner, task, Counters())
        return Counters()
    counters = read_counters(checkpoints[-1])
    learner.load(checkpoints[-1])
    folder.forget_metrics_after(counters)
    return counters


def _save(options: TrainOptions, folder: RunFolder, learner: Learner, task: TaskSpec, counters: Counters) -> None:
    provenance = {
        "env_steps": counters.env_steps,
        "updates": counters.updates,
        "agent_code_sha256": code_hash(options.agent, type(learner.actor)),
        **_origin(options, task),
    }
    folder.save_checkpoint(counters, lambda path: learner.save(path, provenance))


def _origin(options: TrainOptions, task: TaskSpec) -> dict[str, Any]:
    """Returns what is trained, and in which task."""
    values = {name: getattr(task, name) for name in (*fields_of(TaskOptions), *fields_of(Variants))}
    origin = {"agent": options.agent, "size": task.size, "task": values, "seed": options.seed}
    if options.maze_options.is_drawn:
        origin["mazes"] = {name: getattr(options.maze_options, name) for name in fields_of(DrawnOptions)}
    elif options.maze_options.mazes is not None:
        origin["mazes"] = {"sha256": mazes_hash(task)}
    return origin
