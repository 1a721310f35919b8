"""The one training loop: collect, learn at a fixed replay ratio, evaluate now and then, checkpoint."""

from __future__ import annotations

import dataclasses
import math
import pathlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from mazebench.agent import Interface, LearningAgent, load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.evaluation.protocol import select_trials
from mazebench.evaluation.runner import run_trials
from mazebench.maps.generators import generate
from mazebench.records import read_json
from mazebench.tasks.context import default_context_size
from mazebench.tasks.registry import make_spec
from mazebench.tasks.spec import TaskSpec
from mazebench.training.run_folder import COUNTERS, RunFolder
from mazebench.training.sources import InProcessSource, Source, ray_source

_HELD_OUT_SEED = 20_000  # of mazes that are drawn like the benchmark's, and in none of its splits
_HELD_OUT_DISTANCES = (2, 4, 6, 8, 10)
_HELD_OUT_EPISODES = 2  # for each maze and distance


class TrainingError(RunError):
    """A run can't go on; what it saved is intact."""


@dataclasses.dataclass(frozen=True)
class TrainOptions:
    """What is trained, and for how long."""

    agent: str
    size: int = 13
    pairs: str = "random"  # or "fixed": one start-goal pair a maze, the paper's extremely-low-data regime
    seed: int = 0
    overrides: tuple[tuple[str, str], ...] = ()  # of the agent's config, by name
    minutes: float | None = None  # of this sitting
    env_steps: int | None = None  # of the run, all sittings together
    checkpoint_steps: int = 200_000  # agent steps between checkpoints, each with an evaluation
    eval_mazes: int = 20  # held-out ones of an evaluation, with 10 episodes each
    workers: int = 0  # Ray actors that collect; 0 collects in this process
    ray_address: str | None = None  # of a cluster; None starts one on this machine


# Told how far the sitting is, 0 to 1, now and then with a line of what there is to say.
Report = Callable[[float, str | None], None]


def train(
    options: TrainOptions, out: pathlib.Path, resume: bool = False, report: Report = lambda share, line: None
) -> None:
    """Trains an agent in the run folder `out`, from its last checkpoint if `resume`.

    Raises:
      InputError: if an option is wrong, or `out` can't be used.
      TrainingError: if a loss is not finite.
    """
    if options.minutes is None and options.env_steps is None:
        raise InputError("expected --minutes or --env-steps, found neither")
    if options.ray_address is not None and not options.workers:
        raise InputError("--ray needs --workers, the number of actors on the cluster")
    agent_class = load_agent_class(options.agent)
    if not hasattr(agent_class, "build_learner"):
        raise InputError(f"agent {options.agent!r} doesn't learn: its class has no build_learner")
    mazes = make_spec("local", options.size).mazes
    wanted = getattr(agent_class, "context_size", default_context_size)(options.size)
    interface = Interface("local", options.size, wanted)
    learner = agent_class.build_learner(interface, mazes, seed=options.seed, overrides=dict(options.overrides))
    task_options = learner.task_options()
    if options.pairs == "fixed":
        task_options["num_goals"] = 1  # the only goal of a maze is its pair's
    task_spec = make_spec("local", options.size, pairs=options.pairs, context_size=wanted, **task_options)
    with RunFolder(out) as folder:
        _Run(options, folder, learner, task_spec, report).run(resume)


class _Run:
    """One sitting of a run."""

    def __init__(
        self, options: TrainOptions, folder: RunFolder, learner: LearningAgent, task_spec: TaskSpec, report: Report
    ):
        self._options, self._folder, self._learner, self._report = options, folder, learner, report
        self._held_out = _held_out_spec(task_spec, options.eval_mazes)
        self._trials = select_trials("local", self._held_out.mazes, False, _HELD_OUT_DISTANCES, _HELD_OUT_EPISODES)
        self._task_spec = task_spec
        self._env_steps = self._updates = self._saved_steps = 0
        self._sums: dict[str, float] = {}  # of what updates returned since the last line
        self._num_summed = 0

    def run(self, resume: bool) -> None:
        """Trains until the time or the steps are up."""
        # Before anything is written: a cluster that can't be had must not leave a run behind.
        with self._make_source() as source:
            self._train(source, resume)

    def _train(self, source: Source, resume: bool) -> None:
        self._open(resume)
        self._begin = self._last_line = time.monotonic()
        if self._options.env_steps is not None and self._env_steps >= self._options.env_steps:
            self._report(1.0, f"{self._folder.path}: the run is finished, at {self._env_steps:,} steps")
            return
        if self._env_steps:
            self._report(0.0, f"resuming {self._folder.path} at {self._env_steps:,} steps")
        self._steps_at_last_line = self._env_steps
        self._report(0.0, f"{self._options.agent}: {self._learner.description()}")
        self._restart(source)
        while not self._is_over():
            for first_env, experience in source.collect():
                self._learner.observe(experience, first_env)
                self._env_steps += len(experience.action)
            self._learn()
            self._report(min(1.0, self._share()), None)
            if self._env_steps >= self._next_checkpoint:
                self._checkpoint()
                self._restart(source)
        if self._env_steps > self._saved_steps:
            self._checkpoint()

    def _open(self, resume: bool) -> None:
        config = {
            "agent": self._options.agent,
            "size": self._options.size,
            "pairs": self._options.pairs,
            "seed": self._options.seed,
            "checkpoint_steps": self._options.checkpoint_steps,
            "agent_config": self._learner.config(),
        }
        checkpoints = self._folder.checkpoints()
        if checkpoints and not resume:
            raise InputError(f"{self._folder.path}: holds a run already; go on with --resume or name another folder")
        self._folder.check_config(config)
        if not checkpoints:
            self._save()
            return
        self._env_steps, self._updates = _read_counters(checkpoints[-1])
        self._saved_steps = self._env_steps
        self._learner.load(checkpoints[-1])
        self._folder.forget_metrics_after(self._env_steps)

    def _make_source(self) -> Source:
        if self._options.workers:
            return ray_source(self._options, self._task_spec, self._learner)
        return InProcessSource(self._task_spec, self._learner.actor, self._learner.num_envs)

    def _restart(self, source: Source) -> None:
        """New trajectories from every checkpoint on, so that a resumed run goes on as the unbroken one did."""
        source.restart(_mix(self._options.seed, self._env_steps))
        self._next_checkpoint = self._env_steps + self._options.checkpoint_steps

    def _learn(self) -> None:
        for _ in range(self._learner.num_updates_due(self._env_steps) - self._updates):
            values = self._learner.update()
            self._updates += 1
            self._num_summed += 1
            for name, value in values.items():
                if not math.isfinite(value):
                    last = self._folder.checkpoints()[-1]
                    raise TrainingError(
                        f"{name} became {value} at update {self._updates}; last good checkpoint: {last}"
                    )
                self._sums[name] = self._sums.get(name, 0.0) + value

    def _is_over(self) -> bool:
        return self._share() >= 1.0

    def _share(self) -> float:
        """How much of the sitting is done."""
        shares = [0.0]
        if self._options.minutes is not None:
            shares.append(
                (time.monotonic() - self._begin) / (60 * self._options.minutes) if self._options.minutes else 1.0
            )
        if self._options.env_steps is not None:
            shares.append(self._env_steps / max(1, self._options.env_steps))
        return max(shares)

    def _checkpoint(self) -> None:
        metrics: dict[str, Any] = {"env_steps": self._env_steps, "updates": self._updates}
        elapsed = time.monotonic() - self._last_line
        metrics |= {name: value / max(1, self._num_summed) for name, value in self._sums.items()}
        metrics |= {f"success_rate_{distance}": rate for distance, rate in self._evaluate().items()}
        self._folder.log(metrics)
        self._save()
        line = ", ".join(
            f"{name} {value:.3g}" for name, value in metrics.items() if name not in ("env_steps", "updates")
        )
        steps_rate = (self._env_steps - self._steps_at_last_line) / max(elapsed, 1e-9)
        rate = f"{steps_rate:,.0f} steps/s, {self._num_summed / max(elapsed, 1e-9):.1f} updates/s"
        self._report(min(1.0, self._share()), f"{self._env_steps:,} steps, {self._updates:,} updates, {rate}: {line}")
        self._sums, self._num_summed, self._last_line = {}, 0, time.monotonic()
        self._steps_at_last_line = self._env_steps

    def _save(self) -> None:
        counters = {"env_steps": self._env_steps, "updates": self._updates}
        provenance = {**counters, "agent": self._options.agent, "size": self._options.size}
        provenance |= {"pairs": self._options.pairs, "seed": self._options.seed}
        self._folder.save_checkpoint(self._env_steps, counters, lambda folder: self._learner.save(folder, provenance))
        self._saved_steps = self._env_steps

    def _evaluate(self) -> dict[int, float]:
        """Success rate by distance in mazes drawn like the training ones, but never trained in."""
        reached: dict[int, list[bool]] = {distance: [] for distance in _HELD_OUT_DISTANCES}
        for records in run_trials(
            self._learner.actor, self._held_out, list(enumerate(self._trials)), len(self._trials)
        ):
            for record in records:
                reached[record["distance"]].append(record["success"])
        return {distance: float(np.mean(successes)) for distance, successes in reached.items()}


def _held_out_spec(task_spec: TaskSpec, num_mazes: int) -> TaskSpec:
    streams = np.random.SeedSequence([_HELD_OUT_SEED, task_spec.size]).spawn(num_mazes)
    mazes = tuple(
        generate("dfs", task_spec.size, np.random.default_rng(stream), f"held-out-{index}")
        for index, stream in enumerate(streams)
    )
    return dataclasses.replace(task_spec, mazes=mazes, distances=_HELD_OUT_DISTANCES, num_goals=1, pairs="random")


def _read_counters(checkpoint: pathlib.Path) -> tuple[int, int]:
    """Agent steps and updates at a checkpoint, which is named after its steps.

    Raises:
      InputError: if they can't be read.
    """
    counters = read_json(checkpoint / COUNTERS)
    steps, updates = (counters.get(key) if isinstance(counters, dict) else None for key in ("env_steps", "updates"))
    if type(steps) is not int or type(updates) is not int or steps != int(checkpoint.name) or updates < 0:
        raise InputError(
            f"{checkpoint / COUNTERS}: expected env_steps {int(checkpoint.name)} and updates, "
            f"found {str(counters)[:80]}"
        )
    return steps, updates


def _mix(*numbers: int) -> int:
    """One seed from several numbers."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])
