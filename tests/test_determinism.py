"""The same bytes from the same command: docs/determinism.md says what is promised, these hold it."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
from typing import Any

import pytest

from mazebench.evaluation.harness import EvalOptions, Evaluation, evaluate, run_evaluations
from mazebench.evaluation.metrics import summarize
from mazebench.evaluation.results import load_result
from mazebench.evaluation.trajectories import TRAJECTORIES

FILES = ("episodes.jsonl", TRAJECTORIES)
# Agents that draw, plan, correct themselves and ask a network, under every perturbation.
SETTINGS = {
    "random": EvalOptions("random", distances=(2, 6), episodes_per_distance=1),
    "planner": EvalOptions("planner", distances=(4,), episodes_per_distance=1, map_flip=0.2, map_warp=0.2),
    "closed-loop-noise": EvalOptions(
        "planner-closed-loop", distances=(5,), episodes_per_distance=1, position_noise=0.5
    ),
    "hierarchical": EvalOptions("planner-closed-loop", task="hierarchical", map_flip=0.1, position_noise=0.3),
    "mah": EvalOptions("mah", distances=(1, 2), episodes_per_distance=1),
    "mah-noise": EvalOptions("mah", distances=(2,), episodes_per_distance=1, map_flip=0.1, position_noise=0.3),
}
TRAIN = "train --agent mah --env-steps 400 --checkpoint-steps 200 --eval-mazes 1 --set channels=4 --set hidden=16"
TRAIN += " --set groups=4 --set steps=4 --set num_envs=8 --set min_rows=100 --set steps_per_update=32"
COMMANDS = (
    "eval --agent random --distances 2,6 --episodes-per-distance 1 --record",
    "eval --agent planner-closed-loop --task hierarchical --map-flip 0.1 --position-noise 0.3 --record",
    "eval --agent planner --distances 4 --episodes-per-distance 1 --map-warp 0.2 --seed 5 --split train",
    "eval --agent mah --distances 1,2 --episodes-per-distance 1 --map-flip 0.1 --num-envs 16",
    "generate --size 9 --count 2 --seed 3 --format txt,mjcf,png,glb,obj,stl",
    "generate --size 9 --style rooms",
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
    "plain": {"PYTHONHASHSEED": "0", "LC_ALL": "C", "TZ": "UTC"},
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


def bytes_of(folder: pathlib.Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in FILES}


@pytest.fixture(scope="module")
def reference(tmp_path_factory) -> dict[str, dict[str, bytes]]:
    """What each setting gives as 256 environments side by side in this process."""
    found = {}
    for name, options in SETTINGS.items():
        folder = tmp_path_factory.mktemp("reference")
        evaluate(options, folder, record=True)
        found[name] = bytes_of(folder)
    return found


def test_settings_when_compared_with_each_other(reference):
    """They are worth their time: nothing is trivial, and the noise reaches what is driven."""
    assert len({content["episodes.jsonl"] for content in reference.values()}) == len(SETTINGS)
    records = [json.loads(line) for line in reference["mah-noise"]["episodes.jsonl"].splitlines()]
    assert len({record["path_length"] for record in records}) > 10


@pytest.mark.parametrize("num_envs", [1, 7])
@pytest.mark.parametrize("name", SETTINGS)
def test_bytes_when_num_envs_differs(reference, tmp_path, name, num_envs):
    evaluate(SETTINGS[name], tmp_path, record=True, num_envs=num_envs)
    assert bytes_of(tmp_path) == reference[name]


def test_bytes_when_workers_run_them(reference, tmp_path):
    evaluations = [Evaluation(options, tmp_path / name, record=True) for name, options in SETTINGS.items()]
    summaries = run_evaluations(evaluations, resume=False, num_envs=7, workers=2)
    assert {name: bytes_of(tmp_path / name) for name in SETTINGS} == reference
    # The figures follow from the records, in the order in which these stand.
    assert [summary["overall"] for summary in summaries] == [
        summarize(load_result(tmp_path / name).records)["overall"] for name in SETTINGS
    ]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_bytes_when_ray_runs_them(reference, tmp_path):
    pytest.importorskip("ray")
    evaluations = [Evaluation(options, tmp_path / name, record=True) for name, options in SETTINGS.items()]
    run_evaluations(evaluations, resume=False, num_envs=5, workers=2, ray_address="local")
    assert {name: bytes_of(tmp_path / name) for name in SETTINGS} == reference


def run_commands(folder: pathlib.Path, surroundings: dict[str, str], **options: Any) -> dict[str, str]:
    """The SHA-256 of what `COMMANDS` write in a process of its own, below a working directory `folder`."""
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


def test_files_when_surroundings_differ(tmp_path):
    """Hash seeds, locales, time zones, threads, cores and the working directory make no difference to any command."""
    hashes = run_commands(tmp_path / "a", SURROUNDINGS["plain"])
    expected = {"episodes.jsonl": 4, TRAJECTORIES: 2, "metrics.jsonl": 1, "agent.safetensors": 2, "replay.npz": 2}
    for name, count in expected.items():
        assert sum(path.endswith(f"/{name}") for path in hashes) == count
    for suffix, count in {"txt": 3, "xml": 3, "png": 3, "glb": 3, "obj": 2, "stl": 2}.items():
        assert sum(path.endswith(f".{suffix}") for path in hashes) == count
    other = run_commands(tmp_path / "b" / "ä 1", SURROUNDINGS["other"], preexec_fn=on_one_core)
    assert other == hashes


@pytest.mark.slow
def test_files_when_the_machine_is_busy(tmp_path):
    """Four at a time share the cores, so that threads take turns as they never did before."""
    processes = []
    for number in range(4):
        folder = tmp_path / str(number)
        folder.mkdir()
        processes.append(
            subprocess.Popen(
                [sys.executable, "-c", SCRIPT],
                cwd=folder,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        )
    for process in processes:
        assert process.stdin is not None
        process.stdin.write(json.dumps(COMMANDS))
        process.stdin.close()
    outputs = [process.stdout.read() for process in processes if process.stdout]
    assert len(set(outputs)) == 1
    assert len(json.loads(outputs[0])) > 30
