"""Runs that are killed, stopped, short of disk space or not alone in their folder.

Tests of kills and signals start the installed command as a process of its own. A disk that fills is a file system
mounted in memory. docs/guarantees.md#failures has the promises.
"""

from __future__ import annotations

import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from faults import (
    PATIENCE,
    TRAIN,
    Disk,
    descendants,
    num_bytes,
    num_metrics,
    run,
    run_through_kills,
    said,
    start,
    wait_for_ends,
    wait_until,
    workers_of,
)
from faults import disk as disk  # fixtures
from faults import nothing_left as nothing_left
from run_folders import files_of, results_of

pytestmark = pytest.mark.usefixtures("nothing_left")
slow = pytest.mark.slow

SHORT = ["eval", "--agent", "planner", "--distances", "1-4", "--episodes-per-distance", "2", "--record"]
SHORT += ["--num-envs", "8"]
SHORT_EPISODES = 160
LONG = ["eval", "--agent", "random", "--distances", "5-10", "--record", "--num-envs", "16"]
SUITE = ["eval", "--suite", "quick", "--agent", "planner", "--num-envs", "16"]
STEPS = 4000
LEARN = [*TRAIN, "--env-steps", str(STEPS)]
RUNS = {"short": SHORT, "long": LONG, "suite": SUITE, "learn": LEARN}


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory) -> Callable[[str], pathlib.Path]:
    """The folder of a run by name in which nothing went wrong, made when it is first asked for."""
    made: dict[str, pathlib.Path] = {}

    def folder(name: str) -> pathlib.Path:
        if name not in made:
            made[name] = tmp_path_factory.mktemp("unbroken") / name
            status, _, errors = run(*RUNS[name], "--out", made[name])
            assert status == 0, errors
        return made[name]

    return folder


def learned_in(folder: pathlib.Path) -> dict[str, bytes]:
    """The files of a finished training that must be the same after any fault."""
    checkpoints = sorted(path.name for path in (folder / "checkpoints").iterdir())
    assert checkpoints == [f"{STEPS - 800:012d}", f"{STEPS:012d}"]
    paths = [folder / "config.json", folder / "metrics.jsonl"]
    paths += [folder / "checkpoints" / checkpoints[-1] / f"{name}.safetensors" for name in ("agent", "training")]
    return {path.name: path.read_bytes() for path in paths}


def metrics_of(folder: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


class TestKill:
    def test_a_killed_evaluation_resumes_to_the_same_bytes(self, unbroken, tmp_path):
        run_through_kills(np.random.default_rng(0), tmp_path / "run", SHORT, num_kills=1, most_bytes=20_000)
        assert results_of(tmp_path / "run") == results_of(unbroken("short"))

    @slow
    def test_an_evaluation_with_workers_killed_at_any_moment_resumes_to_the_same_bytes(self, unbroken, tmp_path):
        words = [*LONG, "--workers", "2"]
        run_through_kills(np.random.default_rng(1), tmp_path / "run", words, num_kills=3, most_bytes=100_000)
        assert results_of(tmp_path / "run") == results_of(unbroken("long"))

    @slow
    def test_a_dead_worker_ends_the_run_with_one_line(self, unbroken, tmp_path):
        words, rng = [*LONG, "--workers", "2"], np.random.default_rng(4)
        for errors in run_through_kills(rng, tmp_path / "run", words, 2, 100_000, kills_worker=True):
            (line,) = said(errors)
            assert line.startswith("mazebench: ")
            assert "--resume" in line
        assert results_of(tmp_path / "run") == results_of(unbroken("long"))

    @slow
    def test_a_killed_suite_resumes_to_the_same_bytes(self, unbroken, tmp_path):
        run_through_kills(np.random.default_rng(2), tmp_path / "run", SUITE, num_kills=3, most_bytes=40_000)
        assert results_of(tmp_path / "run") == results_of(unbroken("suite"))

    @slow
    def test_a_killed_training_resumes_to_the_same_bytes(self, unbroken, tmp_path):
        folder = tmp_path / "run"
        moments: tuple[Callable[[], object], ...] = (
            lambda: num_metrics(folder) >= 1,
            lambda: num_metrics(folder) >= 2,
            lambda: list(folder.glob("checkpoints/*.tmp")),  # in the middle of saving
        )
        for attempt, has_come in enumerate(moments):
            process = start(*LEARN, "--out", folder, *(["--resume"] if attempt else []))
            wait_until(has_come, process)
            process.kill()
            assert said(process.communicate()[1]) == []
            assert process.returncode == -signal.SIGKILL
        status, _, errors = run(*LEARN, "--out", folder, "--resume")
        assert (status, errors) == (0, "")
        assert learned_in(folder) == learned_in(unbroken("learn"))


class TestFullDisk:
    def test_an_evaluation_on_a_full_disk_goes_on_when_there_is_room(self, disk: Disk, unbroken, command):
        disk.leave(40)
        status, _, errors = run(*SHORT, "--out", disk.path / "run")
        (line,) = said(errors)
        assert status == 1
        assert line.startswith(f"mazebench: {disk.path / 'run'}")
        assert "No space left on device" in line
        assert "--resume" in line
        disk.make_room()
        assert command(*SHORT, "--out", disk.path / "run", "--resume")[0] == 0
        assert results_of(disk.path / "run") == results_of(unbroken("short"))

    @slow
    def test_a_training_on_a_full_disk_goes_on_when_there_is_room(self, disk: Disk, unbroken):
        disk.leave(500)
        status, _, errors = run(*LEARN, "--out", disk.path / "run")
        assert (status, len(said(errors))) == (1, 1), errors
        assert "No space left on device" in errors
        disk.make_room()
        assert run(*LEARN, "--out", disk.path / "run", "--resume")[0] == 0
        assert learned_in(disk.path / "run") == learned_in(unbroken("learn"))

    def test_a_collection_on_a_full_disk_leaves_nothing_and_can_be_run_again(self, disk: Disk, command):
        pytest.importorskip("minari")
        words = ["collect", "--agent", "random", "--distances", "1", "--episodes", "2", "--out"]
        disk.leave(40)
        status, _, errors = command(*words, disk.path / "run")
        (line,) = said(errors)
        assert (status, line.startswith(f"mazebench: {disk.path / 'run'}: can't write")) == (1, True), line
        assert [path.name for path in disk.path.iterdir()] == ["filler"]
        disk.make_room()
        assert [command(*words, disk.path / name)[0] for name in ("run", "other")] == [0, 0]
        assert files_of(disk.path / "run") == files_of(disk.path / "other")

    def test_the_film_from_before_is_kept_when_the_disk_fills(self, disk: Disk, command):
        film = disk.path / "film.mp4"
        film.write_bytes(b"an earlier film")
        disk.leave(4)
        words = ["render", "--agent", "planner", "--distances", "2", "--view", "map", "--pixels", "100"]
        status, _, errors = command(*words, "--out", film)
        assert (status, len(errors.splitlines())) == (2, 1)
        assert errors.startswith(f"mazebench: {film}: can't write")
        assert sorted(path.name for path in disk.path.iterdir()) == ["filler", film.name]
        assert film.read_bytes() == b"an earlier film"


class TestFewOpenFiles:
    @pytest.mark.parametrize("limit", [8, 12, 16])
    def test_too_few_are_named_in_one_line_with_the_way_out(self, limit, tmp_path):
        words = [*SHORT, "--workers", "2", "--out", tmp_path / "run"]
        status, _, errors = run(*words, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit)))
        (line,) = said(errors)
        assert status in (1, 2)
        assert "ulimit -n" in line


class TestReadOnly:
    def test_a_read_only_folder_is_named_in_one_line(self, disk: Disk, command):
        (disk.path / "out").mkdir()
        disk.forbid_writing()
        status, _, errors = command(*SHORT, "--out", disk.path / "out")
        (line,) = said(errors)
        assert status == 2
        assert line.startswith(f"mazebench: {disk.path / 'out'}")
        assert "Read-only file system" in line

    def test_read_only_results_can_be_read(self, disk: Disk, unbroken, command):
        shutil.copytree(unbroken("short"), disk.path / "whole")
        shutil.copytree(unbroken("short"), disk.path / "half")
        (disk.path / "half" / "summary.json").unlink()
        before = files_of(disk.path)
        disk.forbid_writing()
        assert command(*SHORT, "--out", disk.path / "whole", "--resume")[0] == 0
        status, _, errors = command(*SHORT, "--out", disk.path / "half", "--resume")
        assert (status, len(said(errors))) == (2, 1)
        assert "Read-only file system" in errors
        assert command("compare", disk.path / "whole", disk.path / "whole")[0] == 0
        assert files_of(disk.path) == before


def stop(process: subprocess.Popen, number: signal.Signals) -> str:
    """Ends a command and all processes in its group by a signal; returns the last line it prints."""
    os.killpg(process.pid, number)
    _, errors = process.communicate(timeout=PATIENCE)
    word, status = {signal.SIGINT: ("interrupted", 130), signal.SIGTERM: ("terminated", 143)}[number]
    # Python itself ends by SIGINT, 130 to a shell, if the exception went through code that was made by exec().
    assert process.returncode in (status, -signal.SIGINT), errors
    assert "Traceback" not in errors
    line = said(errors)[-1]
    assert line.startswith(f"mazebench: {word}; ")
    return line


def go_on(line: str, folder: pathlib.Path) -> None:
    """Runs the command in the line that a stopped command prints."""
    command = line.partition(" with: ")[2]
    on_path = os.environ | {"PATH": f"{pathlib.Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        command, shell=True, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, env=on_path
    )
    assert done.returncode == 0, done.stderr


class TestStop:
    def test_a_stopped_evaluation_goes_on_with_the_command_it_prints(self, unbroken, tmp_path):
        folder = tmp_path / "my run"  # a name to quote
        process = start(*SHORT, "--out", folder.name, cwd=tmp_path)
        wait_until(lambda: num_bytes(tmp_path) > 10_000, process)
        line = stop(process, signal.SIGTERM)
        kept = int(line.partition("; ")[2].partition(f" of {SHORT_EPISODES} episodes are kept in ")[0])
        assert 0 < kept <= SHORT_EPISODES
        go_on(line, tmp_path)
        assert results_of(folder) == results_of(unbroken("short"))

    def test_no_worker_is_left_when_stopped_while_they_start(self, tmp_path):
        process = start(*SHORT, "--workers", "2", "--out", "run", cwd=tmp_path)
        wait_until(lambda: workers_of(process), process)
        started = descendants(process.pid)
        line = stop(process, signal.SIGINT)
        assert f"; 0 of {SHORT_EPISODES} episodes are kept in run; go on with: " in line
        wait_for_ends(started)

    @slow
    def test_a_stopped_training_goes_on_with_the_command_it_prints(self, tmp_path):
        process = start(*LEARN, cwd=tmp_path)
        wait_until(lambda: num_metrics(tmp_path) > 1, process)
        line = stop(process, signal.SIGTERM)
        folder = tmp_path / "runs" / "mah-13-0"
        steps = [int(path.name) for path in sorted(folder.glob("checkpoints/*"))]
        assert f"; the checkpoint at {steps[-1]:,} steps is kept in runs/mah-13-0; go on with: " in line
        assert steps[-1] > 1600
        assert len(steps) == 2
        go_on(line, tmp_path)
        assert [line["env_steps"] for line in metrics_of(folder)] == list(range(800, STEPS + 1, 800))
        assert metrics_of(folder)[-1]["updates"] == (STEPS - 400) // 32
