"""The evaluation of one agent on one protocol, from options to files; resumable."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import multiprocessing
import os
import pathlib
import platform
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from typing import Any

from mazebench.agent import Agent, Interface, load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.evaluation import metrics
from mazebench.evaluation.protocol import EPISODES_PER_DISTANCE, Trial, select_trials
from mazebench.evaluation.runner import run_trials
from mazebench.maps.benchmark import VERSION, manifest_hash
from mazebench.records import CONFIG, SUMMARY, FolderLock, Record, RecordLog, make_folder, read_json, write_json
from mazebench.tasks.context import default_context_size
from mazebench.tasks.registry import make_spec
from mazebench.tasks.spec import EVAL_DISTANCES, TaskSpec
from mazebench.world.mjcf import maze_spec

_POLL_SECONDS = 1.0  # between looks whether all workers are alive

# Called with the number of episodes done and of all.
Progress = Callable[[int, int], None]


@dataclasses.dataclass(frozen=True)
class EvalOptions:
    """What is evaluated. Two runs with equal options give the same `episodes.jsonl`."""

    agent: str
    task: str = "local"
    size: int | None = None  # of benchmark v1's mazes, 13 if not given; with `maps` only checked
    split: str = "eval"
    maps: str | None = None  # a file or folder of mazes of one's own
    distances: tuple[int, ...] = EVAL_DISTANCES
    episodes_per_distance: int = EPISODES_PER_DISTANCE
    landmark_distance: int = 5
    map_flip: float = 0.0
    map_warp: float = 0.0
    position_noise: float = 0.0
    checkpoint: str | None = None
    seed: int = 0


def evaluate(
    options: EvalOptions,
    out: pathlib.Path,
    *,
    resume: bool = False,
    num_envs: int = 256,
    workers: int = 0,
    progress: Progress = lambda done, of: None,
) -> dict[str, Any]:
    """Runs the evaluation and returns its summary, which `out` then holds beside the records and the options.

    Args:
      options: what to evaluate.
      out: the folder to write to.
      resume: go on with the run that `out` holds; an empty or missing folder starts one.
      num_envs: environments side by side in each process.
      workers: processes; 0 runs in this one, on all cores.
      progress: called as episodes end.

    Raises:
      InputError: if an option can't be met, `out` can't be written or holds another run.
    """
    for name, value, lowest in (
        ("num_envs", num_envs, 1),
        ("workers", workers, 0),
        ("episodes_per_distance", options.episodes_per_distance, 1),
    ):
        if value < lowest:
            raise InputError(f"expected {name} of at least {lowest}, found {value}")
    agent_class = load_agent_class(options.agent)
    options = resolve_checkpoint(options, agent_class)
    task_spec = make_task_spec(options, agent_class)
    trials = select_trials(
        options.task,
        task_spec.mazes,
        is_frozen(options),
        options.distances,
        options.episodes_per_distance,
        options.seed,
    )
    config = _config(options, agent_class, task_spec)
    make_folder(out)
    with FolderLock(out):
        _prepare(out, config, resume)
        return _fill(options, agent_class, task_spec, trials, config, out, num_envs, workers, progress)


def _fill(
    options: EvalOptions,
    agent_class: type[Agent],
    task_spec: TaskSpec,
    trials: Sequence[Trial],
    config: dict[str, Any],
    out: pathlib.Path,
    num_envs: int,
    workers: int,
    progress: Progress,
) -> dict[str, Any]:
    """Runs what `out` has no record of yet, and writes the summary."""
    with RecordLog(out, len(trials)) as log:
        todo = [(index, trials[index]) for index in log.missing]
        progress(len(trials) - len(todo), len(trials))
        for records in _run(options, agent_class, task_spec, todo, num_envs, workers):
            log.add([{**config["record"], **record, **config["perturbation"]} for record in records])
            progress(log.num_done, len(trials))
        summary = {
            **config["record"],
            "benchmark": VERSION,
            "episodes": len(trials),
            "perturbation": config["perturbation"],
            "provenance": _provenance(options, config),
            **metrics.summarize(log.records),
        }
        log.finish()
    write_json(out / SUMMARY, summary)
    return summary


def make_task_spec(options: EvalOptions, agent_class: type[Agent]) -> TaskSpec:
    """The task that `options` name, with the context size that the agent wants."""
    spec = make_spec(
        options.task,
        options.size,
        options.split,
        maps=options.maps,
        distances=options.distances,
        landmark_distance=options.landmark_distance,
        map_flip=options.map_flip,
        map_warp=options.map_warp,
        position_noise=options.position_noise,
    )
    wanted = getattr(agent_class, "context_size", default_context_size)(spec.size)
    return dataclasses.replace(spec, context_size=wanted)


def build_agent(options: EvalOptions, agent_class: type[Agent], task_spec: TaskSpec) -> Agent:
    """The agent for a task."""
    interface = Interface(options.task, task_spec.size, task_spec.context_size)
    checkpoint = None if options.checkpoint is None else pathlib.Path(options.checkpoint)
    return agent_class.build(interface, seed=options.seed, checkpoint=checkpoint)


def is_finished(out: pathlib.Path) -> bool:
    """Whether `out` holds a run that came to its end."""
    return (out / SUMMARY).exists()


def check_same_run(options: EvalOptions, out: pathlib.Path) -> None:
    """Does nothing if the run in `out` is the one of `options`.

    Raises:
      InputError: if it is another; the message names the first difference.
    """
    agent_class = load_agent_class(options.agent)
    options = resolve_checkpoint(options, agent_class)
    _compare(out, _config(options, agent_class, make_task_spec(options, agent_class)))


def _provenance(options: EvalOptions, config: dict[str, Any]) -> dict[str, Any]:
    """What a result came from: versions, benchmark, options, command and machine."""
    packages = ("mazebench-mujoco", "mujoco", "dm-control", "numpy", "scipy", "opencv-python-headless", "torch")
    return {
        "benchmark_manifest_sha256": config["benchmark_manifest_sha256"],
        "checkpoint_sha256": config["checkpoint_sha256"],
        "options": dataclasses.asdict(options),
        "command": [pathlib.Path(sys.argv[0]).name, *sys.argv[1:]],
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in packages},
        "machine": {"system": platform.system(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


def is_frozen(options: EvalOptions) -> bool:
    """Whether the benchmark's eval mazes are asked for, which have frozen episodes."""
    return options.maps is None and options.split == "eval"


def _config(options: EvalOptions, agent_class: type[Agent], task_spec: TaskSpec) -> dict[str, Any]:
    """What identifies a run; `record` and `perturbation` are also the part of it that each record repeats."""
    split = options.split if options.maps is None else "custom"
    return {
        "record": {"agent": options.agent, "task": options.task, "size": task_spec.size, "split": split},
        "perturbation": {
            "map_flip": options.map_flip,
            "map_warp": options.map_warp,
            "position_noise": options.position_noise,
        },
        "benchmark_manifest_sha256": manifest_hash(),
        "mazes_sha256": hashlib.sha256(b"".join(maze.walls.tobytes() for maze in task_spec.mazes)).hexdigest(),
        "agent_code_sha256": _code_hash(options, agent_class),
        "world_sha256": hashlib.sha256(maze_spec(task_spec.mazes[0]).to_xml().encode("utf-8")).hexdigest(),
        "checkpoint_sha256": _hash_of(options.checkpoint),
        "distances": list(options.distances),
        "episodes_per_distance": options.episodes_per_distance,
        "landmark_distance": options.landmark_distance,
        "seed": options.seed,
    }


def _prepare(out: pathlib.Path, config: dict[str, Any], resume: bool) -> None:
    """Makes `out` ready to hold the run of `config`, or refuses."""
    found = sorted(path.name for path in out.iterdir())
    if set(found) <= {f"{CONFIG}.tmp"}:
        write_json(out / CONFIG, config)
        return
    if CONFIG not in found:
        raise InputError(f"{out}: expected an empty folder or an evaluation's, found {found[0]!r} in it")
    if not resume:
        raise InputError(f"{out}: holds a run already; go on with --resume or name another folder")
    _compare(out, config)


def _compare(out: pathlib.Path, config: dict[str, Any]) -> None:
    before = read_json(out / CONFIG)
    for key, value in config.items():
        if not isinstance(before, dict) or before.get(key) != value:
            old = before.get(key) if isinstance(before, dict) else before
            raise InputError(f"{out}: holds another run: its {key} is {old}, this one's {value}")


def _run(
    options: EvalOptions,
    agent_class: type[Agent],
    task_spec: TaskSpec,
    todo: Sequence[tuple[int, Trial]],
    num_envs: int,
    workers: int,
) -> Iterator[list[Record]]:
    if workers == 0 or not todo:
        yield from run_trials(build_agent(options, agent_class, task_spec), task_spec, todo, num_envs)
    else:
        yield from _run_in_processes(options, todo, num_envs, min(workers, len(todo)))


def _run_in_processes(
    options: EvalOptions, todo: Sequence[tuple[int, Trial]], num_envs: int, workers: int
) -> Iterator[list[Record]]:
    """Every worker takes each `workers`-th episode and sends back what ended, step by step."""
    # Not forked: threads of the simulation may be running in this process.
    context = multiprocessing.get_context("spawn")
    results: Any = context.Queue()
    processes = [
        context.Process(target=_work, args=(options, todo[index::workers], num_envs, results), daemon=True)
        for index in range(workers)
    ]
    for process in processes:
        process.start()
    try:
        missing = len(todo)
        while missing:
            try:
                records = results.get(timeout=_POLL_SECONDS)
            except queue.Empty:
                dead = [process.exitcode for process in processes if process.exitcode]
                if dead:
                    raise RunError(f"a worker ended with exit status {dead[0]}; go on with --resume") from None
                continue
            missing -= len(records)
            yield records
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _work(options: EvalOptions, todo: Sequence[tuple[int, Trial]], num_envs: int, results: Any) -> None:
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    agent_class = load_agent_class(options.agent)
    task_spec = make_task_spec(options, agent_class)
    for records in run_trials(build_agent(options, agent_class, task_spec), task_spec, todo, num_envs, num_threads=1):
        results.put(records)


def _end_with(parent: int) -> None:
    """Ends this process when its parent is gone: one that was killed could not end its workers."""
    while os.getppid() == parent:
        time.sleep(_POLL_SECONDS)
    os._exit(1)


def resolve_checkpoint(options: EvalOptions, agent_class: type[Agent]) -> EvalOptions:
    """`options` with the very file that the agent is read from, None for one that reads none.

    A run's folder may gain a newer checkpoint any time, so it is looked into once, before anything is hashed or built.

    Raises:
      InputError: if a checkpoint is given to an agent that reads none.
    """
    default = getattr(agent_class, "default_checkpoint", None)
    if options.checkpoint is None:
        return options if default is None else dataclasses.replace(options, checkpoint=str(default()))
    if default is None and not hasattr(agent_class, "build_learner") and ":" not in options.agent:
        raise InputError(f"agent {options.agent!r} reads no checkpoint; found --checkpoint {options.checkpoint}")
    return dataclasses.replace(options, checkpoint=str(_newest_checkpoint(pathlib.Path(options.checkpoint))))


def _newest_checkpoint(path: pathlib.Path) -> pathlib.Path:
    """`path` itself, or of a training run's folder, or a checkpoint's, the newest agent in it.

    Raises:
      InputError: if a folder holds none.
    """
    if not path.is_dir():
        return path
    found = sorted(path.glob("agent.safetensors")) + sorted(path.glob("checkpoints/*/agent.safetensors"))
    if not found:
        raise InputError(f"{path}: expected a checkpoint or the folder of a training run, found neither")
    return found[-1]


def _code_hash(options: EvalOptions, agent_class: type[Agent]) -> str | None:
    """Of the file of an agent at hand, which may be edited between two sittings of a run; None for installed ones."""
    return _hash_of(inspect.getfile(agent_class)) if ":" in options.agent else None


def _hash_of(path: str | None) -> str | None:
    if path is None:
        return None
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: can't read the checkpoint: {error.strerror}") from error


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
