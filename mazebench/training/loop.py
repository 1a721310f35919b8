"""The training loop: collects, learns at a fixed replay ratio, evaluates and saves checkpoints."""

from __future__ import annotations

import math
import pathlib
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mazebench import stopping
from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.maps.selection import load_mazes_of
from mazebench.tasks.registry import make_spec
from mazebench.tasks.spec import TaskSpec
from mazebench.training.held_out import HeldOutEvaluation
from mazebench.training.options import TrainOptions
from mazebench.training.protocol import Learner, LearningAgent
from mazebench.training.run_folder import Counters, RunFolder
from mazebench.training.sources import InProcessSource, Source

# Called with the share of the sitting that is done, from 0 to 1, and now and then with a line to print.
Report = Callable[[float, str | None], None]


class TrainingError(RunError):
    """A run can't go on; its checkpoints are intact."""


def train(
    options: TrainOptions, out: pathlib.Path, resume: bool = False, report: Report = lambda share, line: None
) -> None:
    """Trains an agent in the run folder `out`; from its last checkpoint if `resume`.

    Raises:
      InputError: if an option is wrong, or `out` can't be used.
      TrainingError: if a loss is not finite.
    """
    agent_class = load_agent_class(options.agent)
    if not issubclass(agent_class, LearningAgent):
        raise InputError(f"agent {options.agent!r} doesn't learn: its class is no LearningAgent")
    context_size = agent_class.context_size(options.size)
    interface = Interface("local", options.size, context_size)
    mazes = load_mazes_of(options.size)
    learner = agent_class.build_learner(interface, mazes, seed=options.seed, overrides=dict(options.overrides))
    task_options = learner.task_options()
    if options.pairs == "fixed":
        task_options["num_goals"] = 1  # a maze has one goal, its pair's
    task_spec = make_spec("local", options.size, pairs=options.pairs, context_size=context_size, **task_options)
    # The source comes first: if the cluster can't be reached, no run is begun.
    with _open_source(options, task_spec, learner) as source, RunFolder(out) as folder:
        counters = _begin_or_resume(options, folder, learner, resume)
        if options.env_steps is not None and counters.env_steps >= options.env_steps:
            report(1.0, f"{out}: the run is finished, at {counters.env_steps:,} steps")
            return
        if counters.env_steps:
            report(0.0, f"resuming {out} at {counters.env_steps:,} steps")
        report(0.0, f"{options.agent}: {learner.description()}")
        held_out = HeldOutEvaluation(task_spec, options.eval_mazes)
        TrainingLoop(options, folder, learner, source, held_out, counters, report).run()


class TrainingLoop:
    """One sitting of a run."""

    def __init__(
        self,
        options: TrainOptions,
        folder: RunFolder,
        learner: Learner,
        source: Source,
        held_out: HeldOutEvaluation,
        counters: Counters,
        report: Report,
    ):
        """Goes on from `counters`, with a `learner` that is as it was there."""
        self._options, self._folder, self._learner, self._source = options, folder, learner, source
        self._held_out, self._report = held_out, report
        self._env_steps, self._updates = counters.env_steps, counters.updates
        self._begin = time.monotonic()
        self._since_checkpoint = _Tally()

    def run(self) -> None:
        """Trains until the time or the steps are up, and leaves a checkpoint of the last step."""
        while self._share_done() < 1.0:
            before = self._env_steps
            self._train_until(before + self._options.checkpoint_steps)
            if self._env_steps > before:
                self._checkpoint()

    def _train_until(self, env_steps: int) -> None:
        # New trajectories from every checkpoint on, so that a resumed run goes on as the unbroken one did.
        for pieces in self._source.collect(_mix(self._options.seed, self._env_steps)):
            stopping.check()
            for first_env, experience in pieces:
                self._learner.observe(experience, first_env)
                num_steps = len(experience.action)
                self._env_steps += num_steps
                self._since_checkpoint.env_steps += num_steps
            for _ in range(self._learner.num_updates_due(self._env_steps) - self._updates):
                self._update()
            self._report(min(1.0, self._share_done()), None)
            if self._env_steps >= env_steps or self._share_done() >= 1.0:
                return

    def _update(self) -> None:
        values = self._learner.update()
        self._updates += 1
        for name, value in values.items():
            if not math.isfinite(value):
                last = self._folder.checkpoints()[-1]
                raise TrainingError(f"{name} became {value} at update {self._updates}; last good checkpoint: {last}")
        self._since_checkpoint.add_update(values)

    def _share_done(self) -> float:
        """Returns the share of the sitting that is done; 1 or more at its end."""
        minutes, env_steps = self._options.minutes, self._options.env_steps
        shares = [0.0]
        if minutes is not None:
            shares.append((time.monotonic() - self._begin) / (60 * minutes) if minutes else 1.0)
        if env_steps is not None:
            shares.append(self._env_steps / max(1, env_steps))
        return max(shares)

    def _checkpoint(self) -> None:
        speed = self._since_checkpoint.speed()
        metrics = self._since_checkpoint.means()
        rates = self._held_out.success_rates(self._learner.actor)
        metrics |= {f"success_rate_{distance}": rate for distance, rate in rates.items()}
        counters = Counters(self._env_steps, self._updates)
        self._folder.log(counters, metrics)
        _save(self._options, self._folder, self._learner, counters)
        values = ", ".join(f"{name} {value:.3g}" for name, value in metrics.items())
        line = f"{self._env_steps:,} steps, {self._updates:,} updates, {speed}: {values}"
        self._report(min(1.0, self._share_done()), line)
        self._since_checkpoint = _Tally()


class _Tally:
    """Counts and sums since the last checkpoint."""

    def __init__(self) -> None:
        self.env_steps = 0
        self._begin = time.monotonic()
        self._updates = 0
        self._sums: dict[str, float] = {}

    def add_update(self, values: Mapping[str, float]) -> None:
        """Adds what an update returned."""
        self._updates += 1
        for name, value in values.items():
            self._sums[name] = self._sums.get(name, 0.0) + value

    def means(self) -> dict[str, float]:
        """Returns the means over the updates, by name."""
        return {name: value / self._updates for name, value in self._sums.items()}

    def speed(self) -> str:
        """Returns steps and updates per second, in words."""
        elapsed = max(time.monotonic() - self._begin, 1e-9)
        return f"{self.env_steps / elapsed:,.0f} steps/s, {self._updates / elapsed:.1f} updates/s"


def _open_source(options: TrainOptions, task_spec: TaskSpec, learner: Learner) -> Source:
    """Raises `InputError` if workers are wanted, and Ray is not installed or its cluster can't be reached."""
    if not options.workers:
        return InProcessSource(task_spec, learner.actor, learner.num_envs)
    from mazebench.training.distributed import RaySource

    return RaySource(task_spec, learner, options.workers, options.ray_address)


def _begin_or_resume(options: TrainOptions, folder: RunFolder, learner: Learner, resume: bool) -> Counters:
    """Saves the first checkpoint of a new run, or loads the last one into `learner`; returns where the run is."""
    config: dict[str, Any] = {
        "agent": options.agent,
        "size": options.size,
        "pairs": options.pairs,
        "seed": options.seed,
        "checkpoint_steps": options.checkpoint_steps,
        "agent_config": learner.config(),
    }
    checkpoints = folder.checkpoints()
    if checkpoints and not resume:
        raise InputError(f"{folder.path}: holds a run already; go on with --resume or name another folder")
    folder.check_config(config)
    if not checkpoints:
        _save(options, folder, learner, Counters())
        return Counters()
    counters = Counters.read(checkpoints[-1])
    learner.load(checkpoints[-1])
    folder.forget_metrics_after(counters.env_steps)
    return counters


def _save(options: TrainOptions, folder: RunFolder, learner: Learner, counters: Counters) -> None:
    provenance = {
        "env_steps": counters.env_steps,
        "updates": counters.updates,
        "agent": options.agent,
        "size": options.size,
        "pairs": options.pairs,
        "seed": options.seed,
    }
    folder.save_checkpoint(counters, lambda path: learner.save(path, provenance))


def _mix(*numbers: int) -> int:
    """Returns one seed made of several numbers."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])
