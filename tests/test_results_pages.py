"""The tables of results in README.md and docs, and the records that they are made from."""

from __future__ import annotations

import dataclasses
import pathlib
import tarfile

import numpy as np
import pandas as pd
import pytest

import mazebench
from benchmarks.results.kept import Kept, all_episodes, keep, read_kept
from benchmarks.results.pages import PAGES, RECORDS, ROOT, with_tables
from benchmarks.results.results_tables import make_table
from mazebench.report.curves import Run
from mazebench.results.reading import load_result

NOTHING = Kept({}, {}, pd.DataFrame(), {}, {})


@pytest.fixture(scope="module")
def kept() -> Kept:
    return read_kept(RECORDS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("results") / "run"
    mazebench.evaluate("random", out=folder, distances=(1,), episodes_per_distance=1)
    return folder


class TestPages:
    @pytest.mark.parametrize("page", PAGES)
    def test_the_tables_of_a_page_are_those_of_the_records(self, page, kept):
        text = (ROOT / page).read_text(encoding="utf-8")
        assert with_tables(text, kept) == text, "`make results` writes them anew"


class TestRecords:
    def test_an_archive_holds_the_evaluation_that_was_kept(self, folder, tmp_path):
        path = keep(folder, tmp_path / "records")
        with tarfile.open(path) as archive:
            archive.extractall(tmp_path, filter="data")
        found, expected = load_result(tmp_path / "run"), load_result(folder)
        assert (found.summary, found.records) == (expected.summary, expected.records)
        assert keep(folder, tmp_path / "again").read_bytes() == path.read_bytes()

    def test_a_training_run_is_kept_with_its_last_checkpoint(self, tmp_path):
        run = tmp_path / "mine" / "seed-3"
        for steps in ("000000000100", "000000000200"):
            (run / "checkpoints" / steps).mkdir(parents=True)
            (run / "checkpoints" / steps / "agent.safetensors").write_text(steps)
            (run / "checkpoints" / steps / "replay.npz").write_text("large")
        (run / "config.json").write_text('{"seed": 3}')
        (run / "metrics.jsonl").write_text('{"env_steps": 100, "success_rate_2": 0.5}\n')
        path = keep(run.parent, tmp_path / "records")
        assert path == tmp_path / "records" / "training" / "mine.tar.xz"
        with tarfile.open(path) as archive:
            inside = ("config.json", "metrics.jsonl", "checkpoints/000000000200/agent.safetensors")
            assert archive.getnames() == [f"mine/seed-3/{name}" for name in inside]


class TestEpisodes:
    def test_every_episode_is_a_line(self, kept):
        episodes = all_episodes(kept)
        navigator = episodes[(episodes.agent == "navigator") & (episodes.setting == "rebuilt-2")]
        assert len(navigator) == 240
        assert f"{navigator.success.mean():.2f}" == "1.00"
        on_time = navigator.success & (navigator.steps <= 1.25 * navigator.oracle_steps)
        assert f"{on_time.mean():.2f}" == "0.72"  # as in the tables
        assert (episodes[episodes.agent == "oracle"].steps >= 1).all()


class TestTrainingRuns:
    def test_means_are_over_the_runs(self, kept):
        runs = kept.training_runs("mmn")
        assert len(runs) == 5
        far = [[record.success for record in run.records if record.distance == 10] for run in runs]
        line = make_table(kept, "paper-runs").splitlines()[2]
        assert line.startswith("| `mmn` | 5 | 1.00 [")
        assert f" {np.mean(far):.2f} [" in line.split("|")[-2]

    def test_a_mean_over_runs_has_students_interval(self):
        # Of .6, .6 and .65: 4.303 times the standard error .0167 to either side. One run has no interval.
        lines = [{"env_steps": 4e5, "success_rate_2": rate} for rate in (0.6, 0.6, 0.65)]
        metrics = [line | {f"success_rate_{distance}": 1.0 for distance in (4, 6, 8, 10)} for line in lines]
        runs = [Run(str(seed), {}, pd.DataFrame([line])) for seed, line in enumerate(metrics)]
        names = ("mmn", "mmn-5-mazes", "mmn-100-mazes", "mmn-fresh", "mmn-fixed", "mmn-one-goal")
        kept = dataclasses.replace(NOTHING, training={**dict.fromkeys(names, runs), "mmn-one-goal": runs[2:]})
        _, _, first, *_, last = make_table(kept, "mmn-regimes").splitlines()
        assert "| 3 | 0.62 [0.54, 0.69] | 1.00 | 1.00 | 1.00 | 1.00 |" in first
        assert "| 1 | 0.65 | 1.00 | 1.00 | 1.00 | 1.00 |" in last

    def test_success_rates_are_of_milestones_that_all_runs_reached(self):
        first = ({"env_steps": 200_064, "success_rate_2": 0.1}, {"env_steps": 300_000, "td_loss": 1.0})
        last = ({"env_steps": 6_600_000, "success_rate_2": 0.8}, {"env_steps": 6_648_448, "success_rate_2": 0.9})
        second = ({"env_steps": 200_128, "success_rate_2": 0.3},)
        kept = dataclasses.replace(
            NOTHING, training={"a": [Run("0", {}, pd.DataFrame([*first, *last])), Run("1", {}, pd.DataFrame(second))]}
        )
        assert kept.success_rates("a", 2) == {0.2: [0.1, 0.3]}
        alone = dataclasses.replace(kept, training={"a": kept.training["a"][:1]})
        assert alone.success_rates("a", 2) == {0.2: [0.1], 6.6: [0.9]}
