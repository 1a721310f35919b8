"""The same bytes from the same command: docs/guarantees.md#determinism says what is promised, these hold it."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from run_folders import results_of

from mazebench.evaluation.evaluate import evaluate
from mazebench.results.metrics import summarize
from mazebench.results.reading import load_result

ONE = {"episodes_per_distance": 1}
# Agents that draw, plan, correct themselves and ask a network, under every perturbation.
SETTINGS: dict[str, dict[str, Any]] = {
    "random": {"agent": "random", "distances": (2, 6), **ONE},
    "planner": {"agent": "planner", "distances": (4,), "map_flip": 0.2, "map_warp": 0.2, **ONE},
    "hierarchical": {
        "agent": "planner-closed-loop",
        "task": "hierarchical",
        "map_flip": 0.1,
        "position_noise": 0.3,
    },
    "mah-noise": {"agent": "mah", "distances": (2,), "map_flip": 0.1, "position_noise": 0.3, **ONE},
}
TRAIN = "train --agent mah --env-steps 200 --checkpoint-steps 200 --eval-mazes 1 --set channels=4 --set hidden=16"
TRAIN += " --set groups=4 --set steps=4 --set num_envs=8 --set min_rows=100 --set steps_per_update=32"
COMMANDS = (
    "eval --agent planner --distances 4 --episodes-per-distance 1 --map-warp 0.2 --record",
    "generate --size 9 --seed 3 --format txt,mjcf,png,glb,obj,stl",
    f"{TRAIN} --set replay_capacity=4000",
)
# Runs each command in this process, and prints the SHA-256 of every file that is promised to be the same.
SCRIPT = """
import contextlib, hashlib, io, json, pathlib, sys
from mazebench import cli

hashes = {}
for number, words in enumerate(json.load(sys.stdin)):
    out = pathlib.Path(str(number))
    sys.argv = ["mazebench", *words.split(), "--out", str(out)]
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        cli.main()
    for path in sorted(out.rglob("*")):
        if path.is_file() and path.name != "summary.json" and "tensorboard" not in path.parts:
            hashes[str(path)] = hashlib.sha256(path.read_bytes()).hexdigest()
print(json.dumps(hashes))
"""
# What must make no difference.
SURROUNDINGS: dict[str, dict[str, str]] = {
    "plain": {"PYTHONHASHSEED": "0", "LC_ALL": "C", "TZ": "UTC", "OMP_NUM_THREADS": "2"},
    "other": {
        "PYTHONHASHSEED": "4711",
        "LC_ALL": "C.UTF-8",
        "TZ": "Asia/Kathmandu",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONUTF8": "1",
        "COLUMNS": "300",
    },
}


def run(name: str, folder: pathlib.Path, **running: Any) -> dict[str, bytes]:
    """Evaluates a setting and returns the files that must not depend on how it is run."""
    evaluate(out=folder, record=True, **SETTINGS[name], **running)
    return results_of(folder)


@pytest.fixture(scope="module")
def reference(tmp_path_factory) -> dict[str, dict[str, bytes]]:
    """Results of each setting with 256 environments side by side in this process."""
    return {name: run(name, tmp_path_factory.mktemp("reference")) for name in SETTINGS}


@pytest.mark.parametrize(("name", "num_envs"), [*((name, 7) for name in SETTINGS), ("mah-noise", 1)])
def test_bytes_do_not_depend_on_the_number_of_environments(reference, tmp_path, name, num_envs):
    assert run(name, tmp_path, num_envs=num_envs) == reference[name]


def test_bytes_do_not_depend_on_workers(reference, tmp_path):
    assert run("planner", tmp_path, num_envs=7, workers=2) == reference["planner"]
    # The figures follow from the records, in the order in which these stand.
    result = load_result(tmp_path)
    assert result.summary.overall.spl_ci95 == summarize(result.records)["overall"].spl_ci95


def run_commands(folder: pathlib.Path, surroundings: dict[str, str], **options: Any) -> dict[str, str]:
    """Returns the SHA-256 of what `COMMANDS` write in a process of its own, below a working directory `folder`."""
    folder.mkdir(parents=True)
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps(COMMANDS),
        cwd=folder,
        env=os.environ | surroundings,
        capture_output=True,
        text=True,
        check=False,
        **options,
    )
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def on_one_core() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


@pytest.mark.slow
def test_files_do_not_depend_on_the_surroundings(tmp_path):
    """Hash seeds, locales, time zones, threads, cores and the working directory make no difference to any command."""
    hashes = run_commands(tmp_path / "a", SURROUNDINGS["plain"])
    names = {pathlib.Path(path).name for path in hashes}
    assert {"episodes.jsonl", "trajectories.npz", "metrics.jsonl", "agent.safetensors", "replay.npz"} <= names
    assert {".txt", ".xml", ".png", ".glb", ".obj", ".stl"} <= {pathlib.Path(path).suffix for path in hashes}
    other = run_commands(tmp_path / "b" / "ä 1", SURROUNDINGS["other"], preexec_fn=on_one_core)
    assert other == hashes


@pytest.mark.slow
def test_files_do_not_depend_on_how_busy_the_machine_is(tmp_path):
    """Four at a time share the cores, so that threads take turns as they never did before."""
    with ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(lambda number: run_commands(tmp_path / str(number), {}), range(4))
    assert others == [first] * 3
    assert len(first) > 15
