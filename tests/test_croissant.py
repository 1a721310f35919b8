"""The Croissant description of the assets: what the command writes, valid, and readable by mlcroissant."""

from __future__ import annotations

import hashlib
import itertools
import json

import pytest

from benchmarks import croissant
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.trials import frozen_trials

TERMS_OF_NEURIPS = ("dataLimitations", "dataBiases", "personalSensitiveInformation", "dataUseCases", "dataSocialImpact")


@pytest.fixture(scope="module")
def shipped() -> dict:
    return json.loads(croissant.OUT.read_text(encoding="ascii"))


@pytest.fixture(scope="module")
def dataset():
    mlcroissant = pytest.importorskip("mlcroissant")
    return mlcroissant.Dataset(croissant.OUT)  # raises ValidationError


def test_the_shipped_file_is_what_the_command_writes(shipped):
    assert shipped == json.loads(json.dumps(croissant.describe())), "run python -m benchmarks.croissant"


def test_every_frozen_file_is_described_with_its_hash(shipped):
    files = {entry["contentUrl"]: entry["sha256"] for entry in shipped["distribution"]}
    folders = [croissant.ASSETS / name for name in croissant.FOLDERS.values()]
    paths = [path for folder in folders for path in folder.iterdir() if path.suffix in (".csv", ".json", ".txt")]
    assert set(files) == {path.relative_to(croissant.ASSETS).as_posix() for path in paths}
    for path in paths:
        content = path.read_bytes()
        assert files[path.relative_to(croissant.ASSETS).as_posix()] == hashlib.sha256(content).hexdigest()


def test_the_fields_of_responsible_ai_have_answers(shipped):
    assert all(shipped[f"rai:{term}"] for term in TERMS_OF_NEURIPS)
    assert shipped["rai:hasSyntheticData"] is True


class TestMlcroissant:
    def test_only_the_date_of_publication_is_missing(self, dataset):
        warnings = dataset.metadata.ctx.issues.warnings
        assert dataset.metadata.ctx.issues.errors == set()
        assert all("datePublished" in warning for warning in warnings), warnings

    def test_episodes_are_read_as_they_are_frozen(self, dataset):
        name = "paper_mazes-episodes-local-13-eval"
        records = list(itertools.islice(dataset.records(name), 100))
        for record, trial in zip(records, frozen_trials("local", 13)[:100], strict=True):
            values = {key.rpartition("/")[2]: value for key, value in record.items()}
            assert (values["start_row"], values["start_column"]) == trial.episode.start
            assert (values["maze"], values["seed"]) == (trial.episode.maze, trial.episode.seed)
            assert (values["yaw"], values["distance"]) == (trial.episode.yaw, trial.distance)

    def test_mazes_are_read_row_by_row(self, dataset):
        name = "paper_mazes-mazes-13-train"
        rows = [record[f"{name}/row"].decode() for record in dataset.records(name)]
        assert len(rows) == 20 * 13
        assert [[cell == "#" for cell in row] for row in rows[:13]] == load_mazes(13, "train")[0].walls.tolist()
