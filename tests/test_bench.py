"""The throughput tables: that they can be measured, not what they say."""

import dataclasses
import json

import pytest

from mazebench.bench import measure as bench
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.task import Task

SPEC = Task.of(mazes=load_mazes(13, "train")[:2], distances=(1, 2, 3, 4, 5))


def test_ratio_of_an_environment_to_the_bare_simulation_is_measured():
    row = bench._ratio("Gymnasium", 1, *bench._gym_pair(SPEC), seconds=0.05, rounds=2)
    assert row["steps/s"] > 0
    assert row["ratio"] > 0


def test_resets_are_measured():
    rows = bench._resets(SPEC, 3)
    assert len(rows) == 2
    assert all(row["ms"] > 0 for row in rows)


def test_the_range_sensor_is_measured():
    row = bench._vector_row(dataclasses.replace(SPEC, sensors=("lidar",)), 2, seconds=0.05, rounds=2)
    assert row["what"] == "2 environments"
    assert row["ratio"] > 0


@pytest.mark.slow
def test_all_tables_are_measured_and_printed(monkeypatch, capsys):
    for name, value in {
        "_QUICK_SECONDS": 0.01,
        "_QUICK_ROUNDS": 1,
        "_SIZES": (13,),
        "_NUM_ENVS": (1, 2),
        "_LIDAR_NUM_ENVS": (1,),
    }.items():
        monkeypatch.setattr(bench, name, value)
    results = json.loads(json.dumps(bench.run(quick=True, say=lambda line: None)))
    assert {row["what"] for row in results["training"]} >= {"mah, 256 envs", "dqn, 256 envs"}
    assert [row["what"] for row in results["num_envs"]][-1] == "2 environments"
    bench.print_tables(results)
    assert "training, and where its time goes" in capsys.readouterr().out
