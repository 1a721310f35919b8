"""The Croissant description of the assets: up to date, valid, and readable by mlcroissant."""

from __future__ import annotations

import itertools
import json

import pytest

from benchmarks import croissant
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.trials import frozen_trials


@pytest.fixture(scope="module")
def dataset():
    mlcroissant = pytest.importorskip("mlcroissant")
    return mlcroissant.Dataset(croissant.OUT)  # raises ValidationError


def test_the_shipped_file_is_what_the_command_writes():
    shipped = json.loads(croissant.OUT.read_text(encoding="ascii"))
    assert shipped == json.loads(json.dumps(croissant.describe())), "run python -m benchmarks.croissant"
    described = {records["field"][0]["source"]["fileObject"]["@id"] for records in shipped["recordSet"]}
    assert described == {file["@id"] for file in shipped["distribution"] if file["name"] != "manifest.json"}


def test_only_the_date_of_publication_is_missing(dataset):
    warnings = dataset.metadata.ctx.issues.warnings
    assert all("datePublished" in warning for warning in warnings), warnings


def test_episodes_are_read_as_they_are_frozen(dataset):
    records = itertools.islice(dataset.records("paper_mazes-episodes-local-13-eval"), 100)
    for record, trial in zip(records, frozen_trials("local", 13)[:100], strict=True):
        values = {key.rpartition("/")[2]: value for key, value in record.items()}
        assert (values["start_row"], values["start_column"]) == trial.episode.start
        assert (values["maze"], values["seed"]) == (trial.episode.maze, trial.episode.seed)
        assert (values["yaw"], values["distance"]) == (trial.episode.yaw, trial.distance)


def test_mazes_are_read_row_by_row(dataset):
    name = "paper_mazes-mazes-13-train"
    rows = [record[f"{name}/row"].decode() for record in dataset.records(name)]
    assert [[cell == "#" for cell in row] for row in rows[:13]] == load_mazes(13, "train")[0].walls.tolist()
