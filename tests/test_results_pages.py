"""The tables of results in README.md and docs, and the records that they are made from."""

from __future__ import annotations

import tarfile

import pandas as pd
import pytest

import mazebench
from benchmarks.results.kept import Kept, keep, read_kept
from benchmarks.results.results_tables import PAGES, RECORDS, ROOT, with_tables
from mazebench.results.reading import load_result


@pytest.fixture(scope="module")
def kept() -> Kept:
    return read_kept(RECORDS)


@pytest.mark.parametrize("page", PAGES)
def test_the_tables_of_a_page_are_those_of_the_records(page, kept):
    text = (ROOT / page).read_text(encoding="utf-8")
    assert "<!-- table: " in text
    assert with_tables(text, kept) == text, "`make results` writes them"


def test_an_archive_holds_the_evaluation_that_was_kept(tmp_path):
    mazebench.evaluate("random", out=tmp_path / "run", distances=(1,), episodes_per_distance=1)
    path = keep(tmp_path / "run", tmp_path / "records")
    with tarfile.open(path) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    found, expected = load_result(tmp_path / "unpacked" / "run"), load_result(tmp_path / "run")
    assert (found.summary, found.records) == (expected.summary, expected.records)
    assert keep(tmp_path / "run", tmp_path / "again").read_bytes() == path.read_bytes()


def test_a_training_run_is_kept_with_its_last_checkpoint(tmp_path):
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


def test_success_rates_are_of_milestones_that_all_runs_reached():
    first = ({"env_steps": 200_064, "success_rate_2": 0.1}, {"env_steps": 300_000, "td_loss": 1.0})
    last = ({"env_steps": 6_600_000, "success_rate_2": 0.8}, {"env_steps": 6_648_448, "success_rate_2": 0.9})
    runs = [pd.DataFrame([*first, *last]), pd.DataFrame(first[:1]).assign(success_rate_2=0.3)]
    both, alone = (Kept(pd.DataFrame(), {}, {"a": some}).success_rates("a", 2) for some in (runs, runs[:1]))
    assert both.to_dict("index") == {0.2: {"mean": 0.2, "min": 0.1, "max": 0.3}}
    assert alone["mean"].to_dict() == {0.2: 0.1, 6.6: 0.9}
