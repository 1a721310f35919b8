"""The training loop: collects, learns at a fixed replay ratio, evaluates and saves checkpoints.

A milestone is a checkpoint with an evaluation, after every so many steps. Trajectories begin anew there, so a run that
is resumed from it goes on as the unbroken one did. A savepoint is a checkpoint between milestones. A run that saves it
goes on unchanged; a run that is resumed from it begins new trajectories there, and so differs from the unbroken one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import logging
import math
import pathlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench import stopping
from mazebench.agent_loading import agent_names, load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.evaluation.checked_agent import context_size_of, sensors_of, unread_sensors
from mazebench.evaluation.provenance import code_hash
from mazebench.maps.kinds import KNOWN
from mazebench.options import check_names, fields_of, options_in
from mazebench.results.played import mazes_hash
from mazebench.tasks.task import Task, as_asked, in_the_same_mazes, options_of, resolve
from mazebench.tasks.task_options import PROGRESS, TaskOptions
from mazebench.training.collector import Collector
from mazebench.training.counters import Counters
from mazebench.training.held_out import HeldOutEvaluation
from mazebench.training.protocol import Learner, LearningAgent
from mazebench.training.run_folder import RunFolder, checkpoints, read_counters
from mazebench.training.train_options import FIXED, NEAR, WIDEN_SHARE, TrainOptions

# As many steps take less than a minute on two cores. They are counted, not timed, so that the same run writes the same
# lines.
STEPS_BETWEEN_LINES = 5_000

_logger = logging.getLogger("mazebench.training")


class TrainingError(RunError):
    """A run can't go on; its checkpoints are intact."""


class Status(NamedTuple):
    """The status of a training."""

    counters: Counters
    share: float  # of the time or of the steps that is done, from 0 to 1: of what ends first
    speed: float  # agent steps per second since the call began
    evaluated: tuple[int, int] | None = None  # held-out episodes that have ended, and all; None unless evaluating

    @property
    def summary(self) -> str:
        """Steps, updates and speed in words."""
        steps, updates = self.counters.env_steps, self.counters.updates
        return f"{steps:,} steps of the run, {updates:,} updates, {self.speed:,.0f} steps/s"

    def __str__(self) -> str:
        """Returns the status in words."""
        if self.evaluated is not None:
            return "{}; evaluating: {:,} of {:,} held-out episodes".format(self.summary, *self.evaluated)
        if losses := self.counters.mean_losses():
            return f"{self.summary}; {_in_words(losses)}"
        return self.summary if self.counters.updates else f"{self.summary}; collecting before learning begins"


# Called with the status after each step.
Progress = Callable[[Status], None]


def train(
    agent: str,
    task: str | Sequence[str] | Task | TaskOptions = "local",
    *,
    out: str | pathlib.Path,
    resume: bool = False,
    progress: Progress = lambda status: None,
    **options: Any,
) -> None:
    """Trains an agent, as `mazebench train` does.

        >>> mazebench.train("dqn", out="runs/dqn-15", minutes=10, size=15)

    The logger "mazebench.training" says what happens. In a block of `mazebench.stopping.stoppable` that waits, a signal
    saves a savepoint and ends the training.

    Args:
      agent: the name of an agent that learns, or "module:Class".
      task: "local", the name of a track, or the names of several, of which each episode draws one; or a `Task`, which
        is trained in as it is.
      out: the run folder.
      resume: go on from the last checkpoint in `out`.
      progress: called with the status after each step.
      **options: by name, as docs/options.md and docs/training.md list them: those of the training (`TrainOptions`:
        minutes, env_steps, seed, checkpoint_steps, overrides, ...), and those of `Task.of`, unless `task` is a `Task`.

    Raises:
      InputError: if an option is wrong, or `out` can't be used.
      TrainingError: if a loss is not finite.
    """
    check_names(options, TrainOptions, TaskOptions)
    of_training = {name: value for name, value in options_in(options, TrainOptions).items() if name != "task"}
    of_task = {name: value for name, value in options.items() if name not in of_training}
    names: Sequence[str] = (task,) if isinstance(task, str) else task if isinstance(task, Sequence) else ()
    asked = as_asked(names[0] if names else task, of_task)  # type: ignore[arg-type]
    chosen = TrainOptions.of(of_training, agent=agent, task=tuple(names) or (options_of(asked).task,))
    run_training(chosen, asked, pathlib.Path(out), resume, progress)


def run_training(
    options: TrainOptions,
    asked: TaskOptions | Task,
    out: pathlib.Path,
    resume: bool = False,
    progress: Progress = lambda status: None,
) -> None:
    """Trains an agent in the tasks that `options` name, as `asked`, the first of them, says."""
    agent_class = load_agent_class(options.agent)
    if not issubclass(agent_class, LearningAgent):
        learning = []
        for name in agent_names():
            with contextlib.suppress(InputError):  # of one whose dependencies are not installed
                learning += [name] if issubclass(load_agent_class(name), LearningAgent) else []
        raise InputError(f"agent {options.agent!r} doesn't learn; agents that do: {', '.join(learning)}")
    if len(options.task) > 1 and not agent_class.learns_several_tasks:
        raise InputError(f"agent {options.agent!r}: learns one track at a time, found {', '.join(options.task)}")
    defaults = agent_class.task_options(options.overrides)
    asked = with_fresh_mazes(asked)
    wanted = [asked, *(asked.replace(task=name) for name in options.task[1:])]
    tasks = tuple(training_task(options.agent, agent_class, defaults, each) for each in wanted)
    if options.first_distance is None and isinstance(asked, TaskOptions) and asked.track is not None:
        options = options.replace(first_distance=NEAR if _farthest(tasks) > NEAR else 0)
    _check_together(options, tasks)
    held_out = [HeldOutEvaluation(task, options.eval_mazes, options_of(asked).distances or ()) for task in tasks]
    tasks = in_the_same_mazes(tasks)
    learner = agent_class.build_learner(tasks[0], seed=options.seed, overrides=options.overrides)
    with RunFolder(out) as folder:
        # The first checkpoint of a new run is saved, or the last one is loaded.
        saved, counters = checkpoints(out), Counters()
        if saved and not resume:
            raise InputError(f"{out}: holds a run already; go on with --resume or name another folder")
        settings = {"checkpoint_steps": options.checkpoint_steps, "agent_config": learner.config()}
        folder.check_config(_origin(options, tasks) | settings)
        if saved:
            counters = read_counters(saved[-1])
            learner.load(saved[-1])
            folder.forget_metrics_after(counters)
        else:
            _save(options, folder, learner, tasks, counters)

        if options.env_steps is not None and counters.env_steps >= options.env_steps and counters.is_milestone:
            _logger.info("%s: the run is finished, at %s steps", out, f"{counters.env_steps:,}")
            return
        if counters.env_steps:
            _logger.info("resuming %s at %s steps", out, f"{counters.env_steps:,}")
        elif resume:
            _logger.info("nothing to resume in %s; starting a new run", out)
        _logger.info("%s: %s", options.agent, learner.description())
        TrainingLoop(options, folder, learner, tasks, held_out, counters, progress).run()


@dataclasses.dataclass
class TrainingLoop:
    """Goes on from the checkpoint at the counters, with a learner that is as it was there."""

    _options: TrainOptions
    _folder: RunFolder
    _learner: Learner
    _tasks: Sequence[Task]
    _held_out: Sequence[HeldOutEvaluation]  # of each task
    _counters: Counters
    _progress: Progress

    def __post_init__(self) -> None:
        self._first_steps, self._first_time = self._counters.env_steps, time.monotonic()
        self._saved_steps, self._saved_time = self._first_steps, self._first_time
        self._longest = 0  # distance of goals now, where it grows
        # One agent acts in the environments of all tasks, and reckons with the worst noise.
        noise = max(task.interface.odometry_noise for task in self._tasks)
        interface = dataclasses.replace(self._tasks[0].interface, odometry_noise=noise)
        self._actor = self._learner.actor.for_interface(interface)
        self._collector = Collector(self._tasks, self._learner.num_envs)

    def run(self) -> None:
        """Trains until the time or the steps are up; the last step is a milestone."""
        while True:
            self._train_until(self._counters.milestone_steps + self._options.checkpoint_steps)
            if not self._counters.is_milestone:
                self._reach_milestone()
            if self._share_done() >= 1.0:
                return

    def _train_until(self, env_steps: int) -> None:
        # New trajectories, so that a run that is resumed from this milestone goes on as the unbroken one did.
        seeds = np.random.SeedSequence((self._options.seed, self._counters.env_steps))
        learner, seed = self._learner, int(seeds.generate_state(1)[0])
        steps = self._collector.collect(self._actor, seed, learner.driven, learner.drive_steps)
        while self._counters.env_steps < env_steps and self._share_done() < 1.0:
            line_steps = self._counters.logged_steps + STEPS_BETWEEN_LINES
            if line_steps <= self._counters.env_steps < env_steps - STEPS_BETWEEN_LINES // 2:  # a milestone has a line
                self._folder.log(self._counters, self._counters.mean_losses())
                self._counters = self._counters.after_line()
            # Where goals are near in the beginning, they are farther as the run goes on.
            if self._options.first_distance:
                so_far = self._counters.env_steps, self._share_of_run()
                longest = longest_distance(self._options, self._tasks, *so_far)
                if longest != self._longest:
                    self._longest = longest
                    self._collector.limit_distances(longest)

            # A step in all environments, and the updates that are due after it.
            experience = next(steps)
            self._learner.observe(experience)
            num_steps = self._counters.env_steps + len(experience.action)
            self._counters = dataclasses.replace(self._counters, env_steps=num_steps)
            for _ in range(num_updates_due(self._learner, num_steps) - self._counters.updates):
                self._learner.share_done = self._share_of_run()
                losses = self._learner.update()
                self._counters = self._counters.after_update(losses)
                for name, value in losses.items():
                    if not math.isfinite(value):
                        last = checkpoints(self._folder.path)[-1]
                        raise TrainingError(
                            f"{name} became {value} at update {self._counters.updates}; last good checkpoint: {last}"
                        )

            self._progress(self._status())
            seconds = 60 * self._options.checkpoint_minutes
            if seconds > 0 and (stopping.is_asked() or time.monotonic() >= self._saved_time + seconds):
                self._save()
            stopping.check()

    def _share_done(self) -> float:
        """Returns the share of the time, or of the steps, that is up, from 0 to 1."""
        return min(1.0, max(self._share_of_time(), self._share_of_steps()))

    def _share_of_time(self) -> float:
        minutes = self._options.minutes
        return 0.0 if minutes is None else (time.monotonic() - self._first_time) / (60 * minutes)

    def _share_of_steps(self) -> float:
        env_steps = self._options.env_steps
        return 0.0 if env_steps is None else self._counters.env_steps / env_steps

    def _share_of_run(self) -> float:
        of_time = share_of_run(self._counters.env_steps, self._first_steps, self._share_of_time())
        return min(1.0, max(of_time, self._share_of_steps()))

    def _status(self, evaluated: tuple[int, int] | None = None) -> Status:
        speed = (self._counters.env_steps - self._first_steps) / (time.monotonic() - self._first_time)
        return Status(self._counters, self._share_done(), speed, evaluated)

    def _save(self) -> None:
        """Saves a checkpoint, unless the last one is of this very step."""
        if self._counters.env_steps != self._saved_steps:
            _save(self._options, self._folder, self._learner, self._tasks, self._counters)
        self._saved_steps, self._saved_time = self._counters.env_steps, time.monotonic()

    def _reach_milestone(self) -> None:
        """Saves, evaluates, and logs; a run that is stopped in the evaluation repeats it when it is resumed."""
        counters, summary = self._counters, self._status().summary
        self._save()
        metrics = counters.mean_losses()
        for held_out in self._held_out:
            rates = held_out.success_rates(
                self._learner.actor.for_interface(held_out.task.interface), self._show_evaluation
            )
            name = f"success_rate_{held_out.task.options.task}" if len(self._held_out) > 1 else "success_rate"
            metrics |= {f"{name}_{distance}": rate for distance, rate in rates.items()}
        self._folder.make_milestone(counters, metrics)
        self._counters = counters.at_milestone()
        _logger.info("%s: %s", summary, _in_words(metrics))

    def _show_evaluation(self, ended: int, of: int) -> None:
        stopping.check()
        self._progress(self._status(evaluated=(ended, of)))


def _in_words(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in values.items())


def num_updates_due(learner: Learner, env_steps: int) -> int:
    """Returns how many updates should have been made after `env_steps` agent steps; the replay ratio is fixed.

    They are one a `steps_per_update` steps after the first `min_rows`; 0 until as many rows are stored, as after a
    resume without the replay.
    """
    if learner.num_rows < learner.min_rows:
        return 0
    return max(0, env_steps - learner.min_rows) // learner.steps_per_update


def _check_together(options: TrainOptions, tasks: Sequence[Task]) -> None:
    """Checks that tasks of several are tracks, and that goals can begin near."""
    if len(tasks) > 1 and any(task.options.track is None for task in tasks):
        raise InputError(f"expected different tracks, found {', '.join(options.task)}")
    if not options.first_distance:
        return
    chosen = [task.options for task in tasks]
    if any(each.num_ends or each.pairs == "fixed" or each.is_hierarchical for each in chosen):
        raise InputError("--first-distance: expected starts and goals that are drawn, found given ones")
    if options.first_distance > (farthest := _farthest(tasks)):
        raise InputError(f"expected --first-distance of at most {farthest}, the farthest goals, found more")


def share_of_run(env_steps: int, first_steps: int, of_time: float) -> float:
    """Returns the share of a run that is done when a share of the time of its last command is up.

    `first_steps` of the `env_steps` were made by the commands before it; the rest of the time makes steps as fast.
    """
    expected = first_steps + (env_steps - first_steps) / of_time if of_time else math.inf
    return env_steps / max(1, expected)


def _farthest(tasks: Sequence[Task]) -> int:
    return max(max(task.options.distances or ()) for task in tasks)


def longest_distance(options: TrainOptions, tasks: Sequence[Task], env_steps: int, share: float) -> int:
    """Returns how far goals are away at most after `env_steps` agent steps, a share of the run, where that grows.

    It is counted as the option `distances` is: on a track in metres, else in cells.
    """
    first, last = options.first_distance or 1, _farthest(tasks)
    grown = share / WIDEN_SHARE if options.widen_steps is None else env_steps / options.widen_steps
    return max(first, min(last, first + int((last - first) * grown)))


def with_fresh_mazes(asked: TaskOptions | Task) -> TaskOptions | Task:
    """Returns what is asked for in fresh mazes, if it is options of a track that leave open which mazes are played."""
    if isinstance(asked, Task) or asked.track is None or asked.mazes is not None or asked.num_mazes is not None:
        return asked
    fresh = asked.fresh is not False
    return asked.replace(fresh=fresh, kinds=asked.kinds or (KNOWN if fresh else ()))


def training_task(
    agent: str, agent_class: type[LearningAgent], defaults: Mapping[str, Any], asked: TaskOptions | Task
) -> Task:
    """Returns the task of a training; `defaults` are the learner's, for what `asked` leaves open."""
    check_names(defaults, TaskOptions)
    options = options_of(asked)
    given = options.changed()
    if isinstance(asked, Task):
        del given["context_size"]  # which the agent chooses
    for name in FIXED:
        wanted = {"split": "train", "actions": "six"}.get(name, fields_of(TaskOptions)[name].default)
        if given.get(name, wanted) != wanted:
            raise InputError(f"expected {name} {wanted!r} in a training, found {given[name]!r}")
    has_one_goal = options.track is not None or options.pairs == "fixed"
    one_goal = {"num_goals": 1} if has_one_goal or options.reward == PROGRESS else {}
    left_open = {name: value for name, value in defaults.items() if name not in given}
    if agent_class.needs_sensors:
        left_open["sensors"] = sensors_of(agent_class, options.sensors)
    asked = asked.replace(**left_open | one_goal)
    task = resolve(asked, context_size_of=functools.partial(context_size_of, agent, agent_class))
    if isinstance(asked, TaskOptions) and asked.track is not None and asked.distances is None:
        task = task.replace(distances=range(1, max(task.options.distances or ()) + 1))  # nearer ones than evaluations
    if needed := [name for name in agent_class.needs_shown if name in task.options.hide]:
        raise InputError(f"agent {agent!r}: needs the {needed[0]}, found it hidden")
    if unread := unread_sensors(agent, agent_class, task.options):
        raise InputError(unread)
    if task.cell_size != 1:
        raise InputError(f"expected mazes with cells of 1 m in a training, found {task.cell_size:g} m (--cell-size)")
    return task


def _save(
    options: TrainOptions, folder: RunFolder, learner: Learner, tasks: Sequence[Task], counters: Counters
) -> None:
    provenance = {
        "env_steps": counters.env_steps,
        "updates": counters.updates,
        "agent_code_sha256": code_hash(options.agent, type(learner.actor)),
        **_origin(options, tasks),
    }
    folder.save_checkpoint(counters, lambda path: learner.save(path, provenance))


def _origin(options: TrainOptions, tasks: Sequence[Task]) -> dict[str, Any]:
    """Returns what is trained, and in which tasks."""
    task, *others = tasks
    values = task.options.to_json() | {"mazes": None if task.options.mazes is None else {"sha256": mazes_hash(task)}}
    origin = {"agent": options.agent, "size": task.size, "task": values, "seed": options.seed}
    if others:
        origin["also"] = [other.options.task for other in others]
    if options.first_distance:
        origin |= {"first_distance": options.first_distance, "widen_steps": options.widen_steps}
    return origin
