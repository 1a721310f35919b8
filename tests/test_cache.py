"""Changed buildings on disk: read as they were made, and made again where something is wrong there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from simple_mazes import field

from mazebench.errors import InputError
from mazebench.maps import changes
from mazebench.maps.kinds import generate
from mazebench.maps.text import format_maze

PLANS = [generate("house", 21, np.random.default_rng(seed)) for seed in (0, 1)]


def made(plan=PLANS[0], strength=1, seed=0):
    building, change = changes.change(plan, strength, np.random.default_rng(seed), "new")
    return building.walls.tobytes(), building.cell_size, building.kind, building.name, str(change)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of a cache in which each building is kept, however fast it was made."""
    monkeypatch.delenv("MAZEBENCH_NO_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(changes, "_KEPT_FROM", 0.0)
    return tmp_path / "cache" / "mazebench" / "changed-buildings"


def test_a_building_is_read_as_it_was_made(folder, monkeypatch):
    first = made()
    [file] = folder.iterdir()
    written = file.stat().st_mtime_ns
    assert made() == first
    assert file.stat().st_mtime_ns == written  # else it would have been made again, and written
    monkeypatch.setenv("MAZEBENCH_NO_CACHE", "1")
    assert made() == first


def test_another_plan_scale_strength_or_seed_is_another_file(folder):
    smaller = dataclasses.replace(PLANS[0], cell_size=0.9)
    for number, asked in enumerate([PLANS[:1], PLANS[1:], [smaller], [PLANS[0], 2], [PLANS[0], 1, 1]], start=1):
        made(*asked)
        assert len(list(folder.iterdir())) == number


def test_what_was_made_fast_or_refused_is_not_kept(folder, monkeypatch):
    with pytest.raises(InputError, match="expected a building in which"):
        made(field(21))
    monkeypatch.setattr(changes, "_KEPT_FROM", np.inf)
    made()
    assert not folder.exists()


@pytest.mark.parametrize("fault", ["cut", "flipped", "another's"])
def test_a_damaged_or_foreign_file_is_made_again(folder, fault):
    first = made()
    [file] = folder.iterdir()
    content = file.read_bytes()
    inside = content.index(b"walls.npy") + 64  # the packed array
    if fault == "another's":
        made(seed=1)
        [other] = set(folder.iterdir()) - {file}
        other.replace(file)
    else:
        flipped = bytes([content[inside] ^ 1]) + content[inside + 1 :]
        file.write_bytes(content[:inside] + (flipped if fault == "flipped" else b""))
    assert made() == first
    assert file.read_bytes() == content


def test_where_nothing_can_be_written_a_line_says_so(folder, tmp_path, monkeypatch, remarks):
    (tmp_path / "file").touch()
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    assert made() == made()
    assert len(set(remarks())) == 1


@pytest.mark.parametrize("asked", ["generate --changed 1", "eval --agent random --track rebuilt --distances 999"])
def test_no_cache_keeps_nothing(folder, tmp_path, command, asked):
    (tmp_path / "plan.txt").write_text(format_maze(PLANS[0]))
    command(*asked.split(), "--mazes", "plan.txt", "--no-cache")
    assert not folder.exists()
