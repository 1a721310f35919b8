"""Evaluations from options to files; resumable, and several at a time."""

from __future__ import annotations

import contextlib
import hashlib
import math
import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from mazebench.agent import load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.evaluation import metrics
from mazebench.evaluation.options import EvalOptions, is_frozen, make_task_spec, resolve_checkpoint
from mazebench.evaluation.protocol import Trial, select_trials
from mazebench.evaluation.provenance import code_hash, file_hash, provenance
from mazebench.evaluation.results import check_records
from mazebench.evaluation.trajectories import JOURNAL, TRAJECTORIES, TrajectoryLog
from mazebench.evaluation.workers import Ended, Job, run_here, run_in_processes
from mazebench.files import WriteError, make_folder, writing_to
from mazebench.maps.benchmark import VERSION, manifest_hash
from mazebench.records import CONFIG, EPISODES, SUMMARY, FolderLock, RecordLog, read_json, write_json
from mazebench.records import JOURNAL as RECORDS_JOURNAL
from mazebench.world.mjcf import maze_spec

_LOGS = {EPISODES, RECORDS_JOURNAL, JOURNAL}  # what grows while a run goes on
# Called with the number of episodes done and of all.
Progress = Callable[[int, int], None]


def evaluate(
    options: EvalOptions,
    out: pathlib.Path,
    *,
    resume: bool = False,
    record: bool = False,
    num_envs: int = 256,
    workers: int = 0,
    ray_address: str | None = None,
    progress: Progress = lambda done, of: None,
) -> dict[str, Any]:
    """Runs the evaluation and returns its summary, which `out` then holds beside the records and the options.

    Args:
      options: what to evaluate.
      out: the folder to write to.
      resume: go on with the run that `out` holds; an empty or missing folder starts one.
      record: write trajectories too.
      num_envs: environments side by side in each process.
      workers: processes; 0 runs in this one, on all cores.
      ray_address: of a Ray cluster to run the workers on; 0 of them then are as many as it has CPUs.
      progress: called as episodes end.

    Raises:
      InputError: if an option can't be met, `out` can't be written or holds another run.
      RunError: if the agent or a worker failed; what ended until then is kept.
    """
    evaluation = Evaluation(options, out, record)
    return run_evaluations(
        [evaluation], resume=resume, num_envs=num_envs, workers=workers, ray_address=ray_address, progress=progress
    )[0]


def is_finished(out: pathlib.Path, record: bool = False) -> bool:
    """Whether `out` holds a run that came to its end, with trajectories if they are to be recorded."""
    return (out / SUMMARY).exists() and (not record or (out / TRAJECTORIES).exists())


def check_same_run(options: EvalOptions, out: pathlib.Path) -> None:
    """Does nothing if the run in `out` is the one of `options`.

    Raises:
      InputError: if it is another; the message names the first difference.
    """
    Evaluation(options, out).check_same_run()


class Evaluation:
    """One evaluation and the folder of its results: what is left to run, and where to put what was."""

    def __init__(
        self, options: EvalOptions, out: pathlib.Path, record: bool = False, labels: Mapping[str, str] | None = None
    ):
        """Reads what is needed and writes nothing; `labels` are more keys for the summary.

        Raises:
          InputError: if an option can't be met.
        """
        if options.episodes_per_distance < 1:
            raise InputError(f"expected episodes_per_distance of at least 1, found {options.episodes_per_distance}")
        self.out = out
        self._record = record
        self.labels = dict(labels or {})
        self._agent_class = load_agent_class(options.agent)
        self._options = resolve_checkpoint(options, self._agent_class)
        self._task_spec = make_task_spec(self._options, self._agent_class)
        self.trials: Sequence[Trial] = select_trials(
            options.task,
            self._task_spec.mazes,
            is_frozen(options),
            options.distances,
            options.episodes_per_distance,
            options.seed,
        )
        self._config = self._make_config()
        self._opened = contextlib.ExitStack()

    @property
    def is_finished(self) -> bool:
        """Whether its folder holds all its results."""
        return is_finished(self.out, self._record)

    def check_same_run(self) -> None:
        """Does nothing if its folder holds this run.

        Raises:
          InputError: if it holds another; the message names the first difference.
        """
        _compare(self.out, self._config)

    def open(self, resume: bool) -> None:
        """Makes its folder ready, and finds out what is left to run.

        Raises:
          InputError: if the folder can't be written, is in use, holds another run or is damaged.
        """
        make_folder(self.out)
        self._opened.enter_context(FolderLock(self.out))
        with writing_to(self.out):
            self._open_logs(resume)

    def _open_logs(self, resume: bool) -> None:
        _prepare(self.out, self._config, resume)
        # Trajectories of a part of the episodes would be of no use: what began to record goes on.
        self._record = self._record or (self.out / JOURNAL).exists()
        log = RecordLog(self.out, len(self.trials))
        check_records(self.out, log.records, self.trials)
        self._log = self._opened.enter_context(log)
        self._todo = set(self._log.missing)
        self._trajectories = None
        if self._record:
            size = self._task_spec.size
            self._trajectories = self._opened.enter_context(TrajectoryLog(self.out, len(self.trials), size))
            self._todo |= set(self._trajectories.missing)

    def close(self) -> None:
        """Closes its files and frees its folder; everything that ended is kept."""
        self._opened.close()

    @property
    def num_done(self) -> int:
        """How many episodes need not be run any more."""
        return len(self.trials) - len(self._todo)

    def jobs(self, number: int, pieces: int) -> Iterator[Job]:
        """What is left to run, in up to `pieces` parts of one size; `number` is what they are called."""
        todo = [(index, self.trials[index]) for index in sorted(self._todo)]
        for piece in range(min(pieces, len(todo))):
            yield Job(number, self._options, tuple(todo[piece::pieces]), self._record, self._task_spec)

    def add(self, ended: Ended) -> None:
        """Puts episodes that ended on disk.

        Raises:
          RunError: if the disk is full, or can't be written any more.
        """
        config = self._config
        with self._keeping_what_is_written():
            if self._trajectories is not None:
                self._trajectories.add(ended.trajectories)
            self._log.add([{**config["record"], **record, **config["perturbation"]} for record in ended.records])
        self._todo -= {record["episode"] for record in ended.records}

    def finish(self) -> dict[str, Any]:
        """Writes the summary, and returns it; all episodes must have ended.

        Raises:
          RunError: as for `add`.
        """
        summary = {
            **self._config["record"],
            **self.labels,
            "benchmark": VERSION,
            "episodes": len(self.trials),
            "perturbation": self._config["perturbation"],
            "provenance": {
                **provenance(self._options, self._agent_class),
                "mazes_sha256": self._config["mazes_sha256"],
            },
            **metrics.summarize(self._log.records),
        }
        with self._keeping_what_is_written():
            if self._trajectories is not None:
                self._trajectories.finish()
            self._log.finish()
            write_json(self.out / SUMMARY, summary)
        self.close()
        return summary

    @contextlib.contextmanager
    def _keeping_what_is_written(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RunError(
                f"{self.out}: can't write there: {error.strerror}; what was written is kept, go on with --resume"
            ) from error

    def _make_config(self) -> dict[str, Any]:
        """What identifies a run; `record` and `perturbation` are also the part of it that each record repeats."""
        options, mazes = self._options, self._task_spec.mazes
        split = options.split if options.maps is None else "custom"
        return {
            "record": {"agent": options.agent, "task": options.task, "size": self._task_spec.size, "split": split},
            "perturbation": {
                "map_flip": options.map_flip,
                "map_warp": options.map_warp,
                "position_noise": options.position_noise,
            },
            "benchmark_manifest_sha256": manifest_hash(),
            "mazes_sha256": hashlib.sha256(b"".join(maze.walls.tobytes() for maze in mazes)).hexdigest(),
            "agent_code_sha256": code_hash(options, self._agent_class),
            "world_sha256": hashlib.sha256(maze_spec(mazes[0]).to_xml().encode("utf-8")).hexdigest(),
            "checkpoint_sha256": file_hash(options.checkpoint),
            "distances": list(options.distances),
            "episodes_per_distance": options.episodes_per_distance,
            "landmark_distance": options.landmark_distance,
            "seed": options.seed,
        }


def run_evaluations(
    evaluations: Sequence[Evaluation],
    *,
    resume: bool,
    num_envs: int,
    workers: int,
    ray_address: str | None = None,
    smallest_job: int = 1,
    progress: Progress = lambda done, of: None,
) -> list[dict[str, Any]]:
    """Runs what is left of several evaluations, each opened when its turn comes; returns their summaries in order.

    Args:
      evaluations: each with a folder of its own.
      resume: go on with what the folders hold.
      num_envs, workers, ray_address, progress: as for `evaluate`.
      smallest_job: the number of episodes below which an evaluation is not split up among workers.

    Raises:
      InputError, RunError: as for `evaluate`.
    """
    for name, value, lowest in (("num_envs", num_envs, 1), ("workers", workers, 0)):
        if value < lowest:
            raise InputError(f"expected {name} of at least {lowest}, found {value}")
    total = sum(len(evaluation.trials) for evaluation in evaluations)
    summaries: dict[int, dict[str, Any]] = {}
    num_done = 0

    def jobs(pieces: int) -> Iterator[Job]:
        nonlocal num_done
        for number, evaluation in enumerate(evaluations):
            try:
                evaluation.open(resume)
            except WriteError as error:
                if number == 0:
                    raise
                raise RunError(f"{error}; what was written is kept, go on with --resume") from error
            num_done += evaluation.num_done
            progress(num_done, total)
            if evaluation.num_done == len(evaluation.trials):
                summaries[number] = evaluation.finish()
            yield from evaluation.jobs(number, min(pieces, math.ceil(len(evaluation.trials) / smallest_job)))

    try:
        with _runner(num_envs, workers, ray_address) as (run, pieces):
            for ended in run(jobs(pieces)):
                evaluation = evaluations[ended.number]
                evaluation.add(ended)
                num_done += len(ended.records)
                progress(num_done, total)
                if evaluation.num_done == len(evaluation.trials):
                    summaries[ended.number] = evaluation.finish()
    finally:
        for evaluation in evaluations:
            evaluation.close()
    return [summaries[number] for number in range(len(evaluations))]


@contextlib.contextmanager
def _runner(
    num_envs: int, workers: int, ray_address: str | None
) -> Iterator[tuple[Callable[[Iterator[Job]], Iterator[Ended]], int]]:
    """What runs jobs, and into how many pieces a large evaluation should be cut for it."""
    if ray_address is not None:
        from mazebench.evaluation.cluster import Cluster  # Ray is an extra

        with Cluster(ray_address) as cluster:
            wanted = workers or cluster.num_cpus
            yield lambda jobs: cluster.run(jobs, num_envs, wanted), wanted
    elif workers:
        yield lambda jobs: run_in_processes(jobs, num_envs, workers), workers
    else:
        yield lambda jobs: run_here(jobs, num_envs), 1


def _prepare(out: pathlib.Path, config: dict[str, Any], resume: bool) -> None:
    """Makes `out` ready to hold the run of `config`, or refuses."""
    found = sorted(path.name for path in out.iterdir())
    if set(found) <= {f"{CONFIG}.tmp"} or _holds_nothing(out, found):
        for name in _LOGS & set(found):
            (out / name).unlink()
        write_json(out / CONFIG, config)
        return
    if CONFIG not in found:
        raise InputError(f"{out}: expected an empty folder or an evaluation's, found {found[0]!r} in it")
    if not resume:
        raise InputError(f"{out}: holds a run already; go on with --resume or name another folder")
    _compare(out, config)


def _holds_nothing(out: pathlib.Path, found: list[str]) -> bool:
    """Whether a run ended before its first episode did, as when its agent could not be built."""
    logs = set(found) - {CONFIG, f"{CONFIG}.tmp"}
    return logs <= _LOGS and all(_is_empty(out / name) for name in logs)


def _is_empty(path: pathlib.Path) -> bool:
    return path.is_file() and not path.is_symlink() and path.stat().st_size == 0


def _compare(out: pathlib.Path, config: dict[str, Any]) -> None:
    before = read_json(out / CONFIG)
    for key, value in config.items():
        if not isinstance(before, dict) or before.get(key) != value:
            old = before.get(key) if isinstance(before, dict) else before
            if key == "agent_code_sha256" and old and value:
                raise InputError(f"{out}: holds another run: its agent's file was changed since; name another folder")
            raise InputError(f"{out}: holds another run: its {key} is {str(old)[:200]}, this one's {value}")
