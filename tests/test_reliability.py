"""Faults, each of a real process: nothing that was written is lost, one line says what to do, and that goes on.

docs/reliability.md has the table of what is tried here.
"""

from __future__ import annotations

import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable

import numpy as np
import pytest
from faults import (
    PATIENCE,
    TRAIN,
    Disk,
    clock_that_goes_back,
    command_line,
    descendants,
    is_running,
    num_lines,
    run,
    run_through_kills,
    said,
    start,
    wait_until,
    waiting,
    workers_of,
)
from faults import disk as disk  # fixtures
from faults import nothing_left as nothing_left
from made_results import make_result

from mazebench.agent import load_agent_class
from mazebench.evaluation.harness import EvalOptions, evaluate
from mazebench.evaluation.options import resolve_checkpoint
from mazebench.evaluation.suites import SuiteRun
from mazebench.evaluation.trajectories import TRAJECTORIES
from mazebench.making import make_mazes, write_maze
from mazebench.training.loop import TrainOptions, train
from mazebench.training.run_folder import RunFolder

pytestmark = pytest.mark.usefixtures("nothing_left")

SHORT = ["eval", "--agent", "planner", "--distances", "1-4", "--episodes-per-distance", "2", "--record"]
SHORT += ["--num-envs", "8"]
SHORT_OPTIONS = EvalOptions("planner", distances=(1, 2, 3, 4), episodes_per_distance=2)
SHORT_EPISODES = 160
LONG = ["eval", "--agent", "random", "--distances", "5-10", "--record", "--num-envs", "16"]
LONG_OPTIONS = EvalOptions("random", distances=(5, 6, 7, 8, 9, 10))
SUITE = ["eval", "--suite", "quick", "--agent", "planner", "--num-envs", "16"]
STEPS = 4000
LEARN = [*TRAIN, "--env-steps", str(STEPS)]

# Looks around; all episodes of a process end at once, in a message of 80 KB.
STILL = """
import numpy as np

class Still:
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls()

    def initial_state(self, batch_size):
        return None

    def act(self, observation, is_first, state, explore=False):
        return np.full(len(is_first), 4), state
"""


def options_of(words: list[str]) -> TrainOptions:
    """What a training command says."""
    values = dict(zip(words[1::2], words[2::2], strict=True))
    overrides = tuple(tuple(word.split("=")) for word in words if "=" in word)
    return TrainOptions(
        values["--agent"],
        overrides=overrides,
        env_steps=int(values["--env-steps"]),
        checkpoint_steps=int(values["--checkpoint-steps"]),
        eval_mazes=int(values["--eval-mazes"]),
    )


def results_of(folder: pathlib.Path) -> dict[str, bytes]:
    """The files of a run, or of a suite, that are the same however it came to its end; nothing else may be left."""
    names = {"config.json", "episodes.jsonl", TRAJECTORIES, "summary.json", "suite.json"}
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert {path.name for path in files} <= names
    return {str(path.relative_to(folder)): path.read_bytes() for path in files if path.name != "summary.json"}


def learned_in(folder: pathlib.Path) -> dict[str, bytes]:
    """The files of a finished training that are the same however it came to its end."""
    checkpoints = sorted(path.name for path in (folder / "checkpoints").iterdir())
    assert checkpoints == [f"{STEPS - 800:012d}", f"{STEPS:012d}"]
    paths = [folder / "config.json", folder / "metrics.jsonl"]
    paths += [folder / "checkpoints" / checkpoints[-1] / f"{name}.safetensors" for name in ("agent", "training")]
    return {path.name: path.read_bytes() for path in paths}


def metrics_of(folder: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


def all_of(folder: pathlib.Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """Folders of runs that nothing happened to, made when they are first asked for."""
    made: dict[str, pathlib.Path] = {}
    makers = {
        "short": lambda out: evaluate(SHORT_OPTIONS, out, record=True),
        "long": lambda out: evaluate(LONG_OPTIONS, out, record=True),
        "suite": lambda out: SuiteRun("quick", ["planner"], out).run(),
        "learn": lambda out: train(options_of(LEARN), out),
    }

    def folder(name: str) -> pathlib.Path:
        if name not in made:
            made[name] = tmp_path_factory.mktemp("unbroken") / name
            makers[name](made[name])
        return made[name]

    return folder


class TestKill:
    def test_evaluation_when_killed_again_and_again(self, unbroken, tmp_path):
        run_through_kills(np.random.default_rng(0), tmp_path / "run", SHORT, num_kills=2, most_lines=60)
        assert results_of(tmp_path / "run") == results_of(unbroken("short"))

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(3))
    @pytest.mark.parametrize("workers", [0, 2])
    def test_evaluation_when_killed_at_other_moments(self, unbroken, tmp_path, workers, seed):
        rng = np.random.default_rng([1, workers, seed])
        words = [*LONG, "--workers", str(workers)]
        run_through_kills(rng, tmp_path / "run", words, num_kills=5, most_lines=80)
        assert results_of(tmp_path / "run") == results_of(unbroken("long"))

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(3))
    def test_suite_when_killed_again_and_again(self, unbroken, tmp_path, seed):
        rng = np.random.default_rng([2, seed])
        run_through_kills(rng, tmp_path / "run", SUITE, num_kills=4, most_lines=80)
        assert results_of(tmp_path / "run") == results_of(unbroken("suite"))

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(3))
    def test_evaluation_when_its_workers_are_killed(self, unbroken, tmp_path, seed):
        kill_workers(np.random.default_rng([4, seed]), tmp_path / "run", [*LONG, "--workers", "2"], 4, 100)
        assert results_of(tmp_path / "run") == results_of(unbroken("long"))

    @pytest.mark.slow
    def test_evaluation_when_a_worker_dies_in_a_message(self, tmp_path, monkeypatch):
        (tmp_path / "still_at_hand.py").write_text(STILL)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
        words = ["--agent", "still_at_hand:Still", "--workers", "2", "--record", "--num-envs", "700"]
        process = start("eval", *words, "--out", tmp_path / "run")
        wait_until(lambda: len(workers_of(process)) == 2, process)
        # Nobody reads what the workers send, until the pipes are full and they wait.
        process.send_signal(signal.SIGSTOP)
        workers = workers_of(process)
        wait_until_idle(workers)
        os.kill(workers[0], signal.SIGKILL)
        process.send_signal(signal.SIGCONT)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 1
        assert said(errors) == ["mazebench: a worker ended with exit status -9; go on with --resume"]

    @pytest.mark.slow
    def test_workers_when_their_parent_is_killed(self, tmp_path):
        process = start(*LONG, "--workers", "2", "--out", tmp_path / "run")
        wait_until(lambda: num_lines(tmp_path) > 20, process)
        children = descendants(process.pid)
        assert len(children) >= 2
        process.kill()
        wait_until(lambda: not any(map(is_running, children)))
        assert said(process.communicate()[1]) == []

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(4))
    def test_training_when_killed_again_and_again(self, unbroken, tmp_path, seed):
        rng, folder, num_kills = np.random.default_rng([6, seed]), tmp_path / "run", 0
        for sitting in range(5):
            process = start(*LEARN, "--out", folder, *(["--resume"] if sitting else []))
            wanted = num_lines(folder) + int(rng.integers(0, 2))
            wait_until(lambda wanted=wanted: num_lines(folder) >= wanted, process)
            if rng.random() < 0.5:  # in the middle of saving
                wait_until(lambda: list(folder.glob("checkpoints/*.tmp")), process)
            else:
                time.sleep(rng.uniform(0, 0.3))
            process.kill()
            assert said(process.communicate()[1]) == []
            num_kills += process.returncode == -signal.SIGKILL
        assert num_kills >= 3
        status, _, errors = run(*LEARN, "--out", folder, "--resume")
        assert (status, errors) == (0, "")
        assert learned_in(folder) == learned_in(unbroken("learn"))

    def test_checkpoint_when_a_kill_left_half_of_one(self, tmp_path):
        for name in (f"{800:012d}", f"{1600:012d}.tmp"):
            (tmp_path / "checkpoints" / name).mkdir(parents=True)
            (tmp_path / "checkpoints" / name / "agent.safetensors").touch()
        (tmp_path / "config.json").touch()
        options = EvalOptions("mah", checkpoint=str(tmp_path))
        found = resolve_checkpoint(options, load_agent_class("mah")).checkpoint
        assert found == str(tmp_path / "checkpoints" / f"{800:012d}" / "agent.safetensors")
        with RunFolder(tmp_path) as folder:
            assert [path.name for path in folder.checkpoints()] == [f"{800:012d}"]
        assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == [f"{800:012d}"]

    @pytest.mark.slow
    def test_mazes_when_killed_while_they_are_made(self, tmp_path):
        words = ["generate", "--count", "200", "--format", "txt,png"]
        process = start(*words, "--out", tmp_path / "killed")
        wait_until(lambda: len(list(tmp_path.glob("killed/*"))) > 100, process)
        process.kill()
        process.communicate()
        assert run(*words, "--out", tmp_path / "unbroken")[0] == 0
        killed, whole = all_of(tmp_path / "killed"), all_of(tmp_path / "unbroken")
        assert 100 < len(killed) < len(whole) == 400
        assert {name: whole[name] for name in killed if not name.endswith(".tmp")}.items() <= killed.items()


def kill_workers(
    rng: np.random.Generator, folder: pathlib.Path, words: list[str], num_kills: int, most_lines: int
) -> None:
    """Runs an evaluation with a worker killed now and then, and to its end."""

    def one_worker(process: subprocess.Popen, rng: np.random.Generator) -> int:
        return int(rng.choice(workers_of(process)))

    for errors in run_through_kills(rng, folder, words, num_kills, most_lines, one_worker):
        assert said(errors) == ["mazebench: a worker ended with exit status -9; go on with --resume"]


def wait_until_idle(pids: list[int]) -> None:
    """Waits until processes have slept for two seconds."""
    before: list[list[str]] = []
    num_same = 0
    for _ in waiting():
        stats = [pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids]
        now = [[stat[0], stat[11], stat[12]] for stat in stats]  # state, and time on the processor
        num_same = num_same + 1 if now == before and all(state == "S" for state, _, _ in now) else 0
        before = now
        if num_same == 200:
            return


@pytest.mark.slow
class TestRay:
    """Ray's own account of what it starts stands among a command's errors, so that only our lines are looked for."""

    def test_training_when_actors_are_killed(self, tmp_path):
        pytest.importorskip("ray")
        many = 80_000  # as it goes on while an actor is replaced, which takes seconds
        process = start(*TRAIN, "--env-steps", str(many), "--workers", "2", "--out", tmp_path / "run")
        rng = np.random.default_rng(7)
        for kill in range(3):
            wait_until(lambda kill=kill: num_lines(tmp_path) > kill, process)
            kill_one(process, actors, 2, rng)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, errors
        # Ray itself starts one anew that is killed before it is ready.
        assert 0 < errors.count("died; it is replaced") <= 3, errors
        metrics = metrics_of(tmp_path / "run")
        steps = [line["env_steps"] for line in metrics]
        assert steps == sorted(set(steps))
        assert steps[-1] >= many
        assert metrics[-1]["updates"] == (steps[-1] - 400) // 32

    def test_evaluation_when_tasks_are_killed(self, unbroken, tmp_path):
        pytest.importorskip("ray")
        process = start(*LONG, "--ray", "local", "--workers", "2", "--out", tmp_path / "run")
        rng = np.random.default_rng(8)
        for kill in range(3):
            wait_until(lambda kill=kill: num_lines(tmp_path) > 60 * kill, process)
            kill_one(process, tasks, 1, rng)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, errors
        assert errors.count("a Ray task was lost; it is run again") == 3
        assert results_of(tmp_path / "run") == results_of(unbroken("long"))

    def test_evaluation_when_told_to_end_while_ray_starts(self, tmp_path):
        pytest.importorskip("ray")
        process = start(*LONG, "--ray", "local", "--workers", "2", "--out", "run", cwd=tmp_path)
        wait_until(lambda: any("gcs_server" in command_line(pid) for pid in descendants(process.pid)), process)
        started = descendants(process.pid)
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 143, errors
        assert "mazebench: terminated; " in errors
        wait_until(lambda: not any(map(is_running, started)))

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_training_when_told_to_end(self, tmp_path, number):
        pytest.importorskip("ray")
        process = start(*LEARN, "--workers", "2", "--out", tmp_path / "run")
        wait_until(lambda: num_lines(tmp_path) > 0, process)
        started = descendants(process.pid)
        line = stop(process, number)
        assert " steps is kept in " in line
        wait_until(lambda: not any(map(is_running, started)))
        go_on(line, tmp_path)
        steps = [line["env_steps"] for line in metrics_of(tmp_path / "run")]
        assert steps == sorted(set(steps))
        assert steps[-1] >= STEPS


def kill_one(
    process: subprocess.Popen,
    find: Callable[[subprocess.Popen], list[int]],
    num: int,
    rng: np.random.Generator,
) -> None:
    """Kills one of the processes that `find` finds, which come and go, as soon as there are `num`."""
    for _ in waiting():
        assert process.poll() is None, "it ended too early: give it more to do"
        found = find(process)
        if len(found) >= num:
            try:
                os.kill(int(rng.choice(found)), signal.SIGKILL)
            except ProcessLookupError:
                continue
            return


def actors(process: subprocess.Popen) -> list[int]:
    """The processes in which a training's Ray actors play."""
    return [pid for pid in descendants(process.pid) if command_line(pid).startswith("ray::_Player")]


def tasks(process: subprocess.Popen) -> list[int]:
    """The processes in which an evaluation's Ray tasks play."""
    return [pid for pid in descendants(process.pid) if command_line(pid).startswith("ray::_play")]


class TestFullDisk:
    def test_evaluation_when_the_disk_fills(self, disk: Disk, unbroken):
        disk.leave(40)
        status, _, errors = run(*SHORT, "--out", disk.path / "run")
        reason = "can't write there: No space left on device; what was written is kept, go on with --resume"
        assert (status, said(errors)) == (1, [f"mazebench: {disk.path / 'run'}: {reason}"])
        written = (disk.path / "run" / "episodes.jsonl").read_bytes()
        whole = written[: written.rfind(b"\n") + 1]
        assert (unbroken("short") / "episodes.jsonl").read_bytes().startswith(whole)
        assert len(whole) > 4000
        disk.make_room()
        status, _, errors = run(*SHORT, "--out", disk.path / "run", "--resume")
        assert (status, said(errors)) == (0, [])
        assert results_of(disk.path / "run") == results_of(unbroken("short"))

    @pytest.mark.slow
    def test_evaluation_when_the_disk_fills_anywhere(self, disk: Disk, unbroken):
        statuses = []
        for kilobytes in (0, *range(4, 160, 12)):
            disk.leave(kilobytes)
            status, _, errors = run(*SHORT, "--out", disk.path / "run")
            statuses.append(status)
            assert len(said(errors)) == (status != 0)
            assert not said(errors) or "No space left on device" in said(errors)[0]
            disk.make_room()
            assert run(*SHORT, "--out", disk.path / "run", "--resume")[0] == 0
            assert results_of(disk.path / "run") == results_of(unbroken("short"))
            shutil.rmtree(disk.path / "run")
        # What can't even begin is the wrong folder for it; what can't go on has failed.
        assert statuses == sorted(statuses, key=[2, 1, 0].index)
        assert set(statuses) == {0, 1, 2}

    @pytest.mark.slow
    def test_training_when_the_disk_fills_anywhere(self, disk: Disk, unbroken):
        statuses = []
        for kilobytes in (0, 8, 40, 48, 52, 56, 60, 100, 200, 260, 330, 500, 700):
            disk.leave(kilobytes)
            status, _, errors = run(*LEARN, "--out", disk.path / "run")
            statuses.append(status)
            assert len(said(errors)) == 1, errors
            assert "No space left on device" in errors
            disk.make_room()
            assert run(*LEARN, "--out", disk.path / "run", "--resume")[0] == 0
            assert learned_in(disk.path / "run") == learned_in(unbroken("learn"))
            shutil.rmtree(disk.path / "run")
        assert statuses == [2] + 12 * [1]

    @pytest.mark.slow
    def test_training_when_no_file_may_grow(self, tmp_path):
        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))

        status, _, errors = run(*LEARN, "--out", tmp_path / "run", preexec_fn=limit)
        assert (status, len(errors.splitlines())) == (1, 1)
        assert "can't save: File too large; last checkpoint: " in errors
        assert [path.name for path in (tmp_path / "run" / "checkpoints").iterdir()] == [12 * "0"]

    def test_mazes_when_the_disk_fills(self, disk: Disk, tmp_path):
        (maze,) = make_mazes(13, 1, 0, "dfs", None)
        write_maze(maze, tmp_path / "whole", ["txt", "mjcf", "png"])
        disk.leave(28)
        status, _, errors = run("generate", "--out", disk.path / "mazes", "--format", "txt,mjcf,png")
        assert (status, len(errors.splitlines())) == (2, 1)
        assert "can't write the picture: No space left on device" in errors
        written, whole = all_of(disk.path / "mazes"), all_of(tmp_path / "whole")
        assert len(written) == 2
        assert written.items() <= whole.items()

    @pytest.mark.parametrize("suffix", ["mp4", pytest.param("gif", marks=pytest.mark.slow)])
    def test_film_when_the_disk_fills(self, disk: Disk, suffix):
        film = disk.path / f"film.{suffix}"
        film.write_bytes(b"an earlier film")
        disk.leave(4)
        words = ["render", "--agent", "planner", "--distances", "2", "--view", "map", "--pixels", "100"]
        status, _, errors = run(*words, "--out", film)
        assert (status, len(errors.splitlines())) == (2, 1)
        assert errors.startswith(f"mazebench: {film}: can't write")
        assert sorted(path.name for path in disk.path.iterdir()) == ["filler", film.name]
        assert film.read_bytes() == b"an earlier film"

    @pytest.mark.slow
    def test_report_when_the_disk_fills_anywhere(self, disk: Disk, tmp_path):
        make_result(tmp_path / "results", "planner", num_mazes=3)
        before = all_of(tmp_path / "results")
        statuses = []
        for kilobytes in (0, 4, 20, 40, 60, 80, 120, 200, 1000):
            disk.leave(kilobytes)
            status, _, errors = run("report", tmp_path / "results", "--out", disk.path / "report")
            statuses.append(status)
            assert len(errors.splitlines()) == (status != 0), errors
            disk.make_room()
        assert statuses == sorted(statuses, reverse=True)
        assert (statuses[0], statuses[-1]) == (2, 0)
        assert all_of(tmp_path / "results") == before


class TestReadOnly:
    @pytest.mark.parametrize(
        "words",
        [
            SHORT,
            pytest.param(SUITE, marks=pytest.mark.slow),
            pytest.param(LEARN, marks=pytest.mark.slow),
            ["generate"],
            pytest.param(["report", "results"], marks=pytest.mark.slow),
        ],
        ids=lambda words: " ".join(words[:2]),
    )
    def test_command_when_its_folder_is_read_only(self, disk: Disk, tmp_path, words):
        make_result(tmp_path / "results", "planner", num_mazes=1)
        (disk.path / "out").mkdir()
        disk.forbid_writing()
        status, _, errors = run(*words, "--out", disk.path / "out", cwd=tmp_path)
        assert (status, len(said(errors))) == (2, 1)
        assert said(errors)[0].startswith(f"mazebench: {disk.path / 'out'}")
        assert "Read-only file system" in errors

    @pytest.mark.slow
    def test_results_when_they_are_read_only(self, disk: Disk, unbroken, tmp_path):
        shutil.copytree(unbroken("short"), disk.path / "whole")
        shutil.copytree(unbroken("short"), disk.path / "half")
        (disk.path / "half" / "summary.json").unlink()
        before = all_of(disk.path)
        disk.forbid_writing()
        assert run(*SHORT, "--out", disk.path / "whole", "--resume")[0] == 0
        status, _, errors = run(*SHORT, "--out", disk.path / "half", "--resume")
        assert (status, len(said(errors))) == (2, 1)
        assert "Read-only file system" in errors
        assert run("compare", disk.path / "whole", disk.path / "whole")[0] == 0
        assert run("report", disk.path / "whole", "--out", tmp_path / "report")[0] == 0
        assert all_of(disk.path) == before


class TestClock:
    def test_evaluation_when_the_clock_goes_back(self, unbroken, tmp_path):
        environment = clock_that_goes_back(tmp_path / "clock")
        status, _, errors = run(*SHORT, "--out", tmp_path / "run", env=environment)
        assert (status, said(errors)) == (0, [])
        assert results_of(tmp_path / "run") == results_of(unbroken("short"))

    @pytest.mark.slow
    def test_evaluation_when_resumed_before_it_began(self, unbroken, tmp_path):
        process = start(*SHORT, "--workers", "2", "--out", tmp_path / "run")
        wait_until(lambda: num_lines(tmp_path) > 20, process)
        stop(process, signal.SIGTERM)
        environment = clock_that_goes_back(tmp_path / "clock")
        words = [*SHORT, "--workers", "2", "--out", tmp_path / "run", "--resume"]
        assert run(*words, env=environment)[0] == 0
        assert results_of(tmp_path / "run") == results_of(unbroken("short"))

    @pytest.mark.slow
    def test_training_when_the_clock_goes_back(self, unbroken, tmp_path):
        environment = clock_that_goes_back(tmp_path / "clock")
        process = start(*LEARN, "--out", tmp_path / "run")
        wait_until(lambda: num_lines(tmp_path) > 0, process)
        process.kill()
        process.communicate()
        status, _, errors = run(*LEARN, "--out", tmp_path / "run", "--resume", env=environment)
        assert (status, errors) == (0, "")
        assert learned_in(tmp_path / "run") == learned_in(unbroken("learn"))


class TestTwoProcesses:
    def test_evaluation_when_another_runs_in_its_folder(self, unbroken, tmp_path):
        two_processes(SHORT, tmp_path / "run")
        assert results_of(tmp_path / "run") == results_of(unbroken("short"))

    @pytest.mark.slow
    def test_suite_when_another_runs_in_its_folder(self, unbroken, tmp_path):
        two_processes(SUITE, tmp_path / "run")
        assert results_of(tmp_path / "run") == results_of(unbroken("suite"))

    @pytest.mark.slow
    def test_training_when_another_runs_in_its_folder(self, unbroken, tmp_path):
        two_processes(LEARN, tmp_path / "run")
        assert learned_in(tmp_path / "run") == learned_in(unbroken("learn"))


def two_processes(words: list[str], folder: pathlib.Path) -> None:
    """A first process, which is killed, a second one in its place, and a third one, which comes too late."""
    first = start(*words, "--out", folder)
    wait_until(lambda: num_lines(folder) > 0, first)
    first.kill()
    first.wait()
    second = start(*words, "--out", folder, "--resume")
    wait_until(lambda: is_locked(folder), second)
    second.send_signal(signal.SIGSTOP)  # so that it is not over before the third one comes
    status, _, errors = run(*words, "--out", folder, "--resume")
    assert (status, said(errors)) == (2, [f"mazebench: {folder}: is in use by another process"])
    second.send_signal(signal.SIGCONT)
    _, errors = second.communicate(timeout=PATIENCE)
    assert (second.returncode, said(errors)) == (0, [])
    first.communicate()


def is_locked(folder: pathlib.Path) -> bool:
    """Whether some process has a lock on a folder."""
    return f":{folder.stat().st_ino} " in pathlib.Path("/proc/locks").read_text()


def stop(process: subprocess.Popen, number: signal.Signals) -> str:
    """Ends a command and all processes in its group by a signal; returns the line that it leaves."""
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
    """Does what the line of a command that was ended says, as one would by copying it."""
    command = line.partition(" with: ")[2]
    done = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr


class TestStop:
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_evaluation_when_told_to_end(self, unbroken, tmp_path, number):
        out = ["--out", "my run"] if number == signal.SIGTERM else []  # a name to quote, or results/planner-local-...
        process = start(*SHORT, *out, cwd=tmp_path)
        wait_until(lambda: num_lines(tmp_path) > 20, process)
        line = stop(process, number)
        (folder,) = tmp_path.glob("my run" if out else "results/*")
        kept = int(line.partition("; ")[2].partition(f" of {SHORT_EPISODES} episodes are kept in ")[0])
        lines = [line for path in folder.glob("*.jsonl") for line in path.read_text().splitlines()]
        # Some may have been written that were not counted yet.
        assert 0 < kept <= len({json.loads(line)["episode"] for line in lines})
        go_on(line, tmp_path)
        assert results_of(folder) == results_of(unbroken("short"))

    @pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
    def test_workers_when_told_to_end_while_they_start(self, tmp_path, number):
        process = start(*SHORT, "--workers", "2", "--out", "run", cwd=tmp_path)
        wait_until(lambda: workers_of(process), process)
        started = descendants(process.pid)
        line = stop(process, number)
        assert f"; 0 of {SHORT_EPISODES} episodes are kept in run; go on with: " in line
        wait_until(lambda: not any(map(is_running, started)))

    @pytest.mark.slow
    def test_evaluation_when_interrupts_are_ignored(self, unbroken, tmp_path):
        """As a shell starts what runs in the background."""
        nobody = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)}
        process = start(*SHORT, "--out", "run", cwd=tmp_path, **nobody)
        wait_until(lambda: num_lines(tmp_path) > 0, process)
        process.send_signal(signal.SIGINT)
        written = num_lines(tmp_path)
        wait_until(lambda: num_lines(tmp_path) > written + 10, process)
        go_on(stop(process, signal.SIGTERM), tmp_path)
        assert results_of(tmp_path / "run") == results_of(unbroken("short"))

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_suite_when_told_to_end(self, unbroken, tmp_path, number):
        process = start(*SUITE, "--workers", "2", "--out", "run", cwd=tmp_path)
        wait_until(lambda: num_lines(tmp_path) > 250, process)
        line = stop(process, number)
        assert " of 420 episodes are kept in run; go on with: " in line
        go_on(line, tmp_path)
        assert results_of(tmp_path / "run") == results_of(unbroken("suite"))

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_training_when_told_to_end(self, unbroken, tmp_path, number):
        process = start(*LEARN, cwd=tmp_path)
        wait_until(lambda: num_lines(tmp_path) > 1, process)
        line = stop(process, number)
        steps = int(max(path.name for path in tmp_path.glob("runs/mah-13-0/checkpoints/*") if path.suffix != ".tmp"))
        assert f"; the checkpoint at {steps:,} steps is kept in runs/mah-13-0; go on with: " in line
        go_on(line, tmp_path)
        assert learned_in(tmp_path / "runs" / "mah-13-0") == learned_in(unbroken("learn"))

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_report_when_told_to_end(self, tmp_path, number):
        make_result(tmp_path / "results", "planner", num_mazes=3)
        process = start("report", "results", "--out", "report", cwd=tmp_path)
        wait_until(lambda: list(tmp_path.glob("report/figures/*")), process)
        line = stop(process, number)
        assert "; the report in report is not whole; make it anew with: " in line
        go_on(line, tmp_path)
        assert (tmp_path / "report" / "report.html").exists()
