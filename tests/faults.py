"""Processes of the installed command, killed at random moments, and disks that fill."""

from __future__ import annotations

import contextlib
import os
import pathlib
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pytest

COMMAND = str(pathlib.Path(sys.executable).with_name("mazebench"))
PATIENCE = 300  # seconds that nothing here takes, on however busy a machine

# A network, batch and replay that take seconds.
TINY = {
    "channels": "4",
    "hidden": "16",
    "groups": "4",
    "steps": "4",
    "num_envs": "8",
    "min_rows": "400",
    "steps_per_update": "32",
    "replay_capacity": "4000",
}
TRAIN = ["train", "--agent", "mah", "--checkpoint-steps", "800", "--eval-mazes", "1"]
TRAIN += [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]


def start(*words: str | pathlib.Path, **options) -> subprocess.Popen:
    """Starts a command in a process group of its own, where interrupts work as on a terminal."""

    def heed_interrupts() -> None:
        # Where these tests run in the background, interrupts are ignored, and processes inherit that.
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    options = {"preexec_fn": heed_interrupts, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    process = subprocess.Popen([COMMAND, *map(str, words)], text=True, start_new_session=True, **options)
    _started.append(process)
    return process


_started: list[subprocess.Popen] = []


@pytest.fixture
def nothing_left() -> Iterator[None]:
    """Ends what a test that failed left running."""
    yield
    for process in _started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    _started.clear()


def run(*words: str | pathlib.Path, **options) -> tuple[int, str, str]:
    """Exit status, output and errors of a command."""
    process = start(*words, **options)
    output, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, output, errors


def said(errors: str) -> list[str]:
    """The lines of standard error without those of progress."""
    return [line for line in errors.splitlines() if not line.endswith(" episodes")]


def wait_until(condition: Callable[[], object], process: subprocess.Popen) -> None:
    """Waits until `condition` holds or `process` ends, at most for `PATIENCE`; looks a hundred times a second."""
    for _ in range(100 * PATIENCE):
        if condition():
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=0.01)
            return
    raise TimeoutError(f"waited for {PATIENCE} s")


def wait_for_ends(pids: Iterable[int]) -> None:
    """Waits until processes, of whatever parent, have ended."""
    for pid in pids:
        with contextlib.suppress(ProcessLookupError), open(os.pidfd_open(pid)) as process:
            assert select.select([process], [], [], PATIENCE)[0], f"waited for {PATIENCE} s"


def num_bytes(folder: pathlib.Path) -> int:
    """Bytes of results that evaluations below `folder` have written, in whatever files."""
    count = 0
    for path in folder.rglob("*"):
        with contextlib.suppress(FileNotFoundError):  # a file that has just been removed
            count += path.stat().st_size if path.is_file() and path.suffix != ".json" else 0
    return count


def num_metrics(folder: pathlib.Path) -> int:
    """Lines of metrics that trainings below `folder` have written."""
    # os.walk passes over folders that are renamed meanwhile, which rglob does not.
    paths = [pathlib.Path(root) / "metrics.jsonl" for root, _, files in os.walk(folder) if "metrics.jsonl" in files]
    return sum(path.read_bytes().count(b"\n") for path in paths)


def run_through_kills(
    rng: np.random.Generator,
    folder: pathlib.Path,
    words: list[str],
    num_kills: int,
    most_bytes: int,
    kills_worker: bool = False,
) -> list[str]:
    """Runs a command that writes to `folder`, killed and resumed `num_kills` times, and then to its end.

    Args:
      rng: draws the moments of the kills, each after so many more bytes of results.
      most_bytes: of results between two kills.
      kills_worker: whether one of its worker processes is killed instead of the command's own.

    Returns:
      The standard error of each process that was killed.
    """
    errors = []
    for attempt in range(num_kills):
        process = start(*words, "--out", folder, *(["--resume"] if attempt else []))
        wanted = num_bytes(folder) + int(rng.integers(1, most_bytes + 1))
        wait_until(lambda wanted=wanted: num_bytes(folder) >= wanted, process)
        if process.poll() is None:
            os.kill(int(rng.choice(workers_of(process))) if kills_worker else process.pid, signal.SIGKILL)
        errors.append(process.communicate(timeout=PATIENCE)[1])
        assert process.returncode != 0, f"it ended before kill {attempt}: give it more to do"
        assert "Traceback" not in errors[-1]
    status, _, last = run(*words, "--out", folder, "--resume")
    assert (status, said(last)) == (0, [])
    return errors


def workers_of(process: subprocess.Popen) -> list[int]:
    """The worker processes of an evaluation."""
    return [pid for pid in descendants(process.pid) if "spawn_main" in command_line(pid)]


def descendants(pid: int) -> list[int]:
    """All processes below a process."""
    found = []
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children = task.read_text().split()
        except OSError:  # a thread that has just ended
            continue
        for child in map(int, children):
            found += [child, *descendants(child)]
    return found


def command_line(pid: int) -> str:
    """The words of a process's command; empty if it is gone."""
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


class Disk:
    """A small file system."""

    def __init__(self, path: pathlib.Path):
        self.path = path
        self._filler = path / "filler"

    def leave(self, kilobytes: int) -> None:
        """Fills it until `kilobytes` KiB are free."""
        free = os.statvfs(self.path)
        self._filler.write_bytes(bytes(free.f_bavail * free.f_frsize - 1024 * kilobytes))

    def make_room(self) -> None:
        """Frees what `leave` filled."""
        self._filler.unlink()

    def forbid_writing(self) -> None:
        """Makes it read-only."""
        subprocess.run(["mount", "-o", "remount,ro", str(self.path)], check=True)


@pytest.fixture
def disk(nothing_left: None, tmp_path: pathlib.Path) -> Iterator[Disk]:
    """A disk of 4 MiB; skips where one may not be mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if shutil.which("mount") is None:
        pytest.skip("a small disk needs mount, which is not installed")
    command = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(folder)]
    mounted = subprocess.run(command, capture_output=True, text=True)
    if mounted.returncode:
        pytest.skip(f"a small disk needs the right to mount it: {mounted.stderr.strip()}")
    yield Disk(folder)
    subprocess.run(["umount", str(folder)], check=True)
