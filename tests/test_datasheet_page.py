"""The numbers of the datasheet and of the criteria, counted again."""

from __future__ import annotations

import re

from pages import ROOT, read

from benchmarks import croissant
from mazebench.maps.benchmark import ALL_SPLITS, SIZES, SPLITS, TRACKS_BENCHMARK, load_kind_mazes, load_mazes
from mazebench.tasks.trials import benchmark_task_sizes, frozen_trials

DATASHEET = read(ROOT / "docs" / "datasheet.md")
CRITERIA = read(ROOT / "docs" / "criteria.md")


def test_mazes_and_episodes_are_as_many():
    mazes = sum(len(load_mazes(size, split)) for size in SIZES for split in SPLITS)
    mazes += sum(len(load_kind_mazes(split)) for split in ALL_SPLITS)
    episodes = sum(count for _, _, count in benchmark_task_sizes())
    episodes += sum(len(frozen_trials("local", 31, TRACKS_BENCHMARK, split)) for split in ("dev", "eval"))
    assert f"{mazes} mazes as text" in DATASHEET
    assert f"{episodes:,} episodes as rows of CSV" in DATASHEET


def test_the_files_are_as_large():
    folders = [croissant.ASSETS / name for name in croissant.FOLDERS.values()]
    sizes = [
        path.stat().st_size
        for folder in folders
        for path in folder.iterdir()
        if path.suffix != ".py" and path.is_file()
    ]
    assert f"{sum(sizes) / 1e6:.1f} MB" in DATASHEET


def test_each_criterion_of_the_checklist_has_an_answer():
    rows = re.findall(r"^\| [^|]+ \| (yes|partly|no|n/a) \|", CRITERIA, re.MULTILINE)
    assert len(rows) == 40
