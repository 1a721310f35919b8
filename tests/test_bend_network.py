"""The network that guesses how a drawn map is bent: geometry, errors, training, and what goes on without it."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest
import torch
from mazebench_agents.common.symmetry import NUM_SYMMETRIES, turn_cells
from mazebench_agents.navigator import Navigator
from mazebench_agents.robot import map_reading
from mazebench_agents.robot.bend_network import PLACES, load, on_picture, turn_bends
from mazebench_agents.robot.bend_training import Drawings, true_bends
from mazebench_agents.robot.drawn_map import Guess, drawing_box, register
from mazebench_agents.robot.map_reading import BENDS, map_reader, read_map

import mazebench
from mazebench.errors import InputError, Remark
from mazebench.maps.kinds import KNOWN, NOVEL, generate
from mazebench.tasks.context import build_context
from mazebench.tasks.task import Task

SIZE = 31


@pytest.fixture(scope="module")
def network():
    return load(BENDS)


def drawings(bend, count):
    """Drawings of train kinds that the shipped network was not trained on."""
    stream = Drawings(seed=5_000)
    return [stream.draw(bend) for _ in range(count)]


def misread(registration, drawn):
    """The share of the inner cells that are read wrong."""
    return ((registration.walls > 0.5) != drawn.walls)[1:-1, 1:-1].mean()


def context_of(drawn):
    return build_context(drawn.picture, (30, 30), (20, 20), 2 * SIZE)


class TestGeometry:
    def test_a_point_is_drawn_at_a_place_and_its_displacement(self):
        for drawn in drawings(1.5, 3):
            edges = (on_picture(PLACES, *ends) for ends in drawing_box(drawn.picture))
            places, pixels = (np.stack(np.meshgrid(*each, indexing="ij")) for each in ((PLACES, PLACES), edges))
            # `HandDrawing.points` has x and y from the lower left corner.
            down, right = (places + true_bends(drawn)).reshape(2, -1)
            x, y = drawn.drawing.points(np.stack([right, SIZE - down], axis=1), SIZE).T
            np.testing.assert_allclose(np.stack([2 * SIZE - y, x]), pixels.reshape(2, -1), atol=0.02)

    @pytest.mark.parametrize("symmetry", range(NUM_SYMMETRIES))
    def test_displacements_turn_with_the_drawing(self, symmetry):
        bends = torch.randn(2, 32, 32)
        turned = turn_bends(bends, symmetry)
        for cell in torch.randint(32, (5, 2)):
            there, moved = (turn_cells(each, 32, symmetry) for each in (cell, cell + bends[:, *cell]))
            torch.testing.assert_close(turned[:, *there], moved - there, atol=1e-4, rtol=0)


class TestShippedNetwork:
    @pytest.mark.parametrize(("bend", "most_off"), [(0.5, 0.05), (1.0, 0.08), (1.5, 0.15)])
    def test_errors_are_small_and_as_large_as_it_says(self, network, bend, most_off):
        true = [(network.read(drawn.picture), true_bends(drawn)) for drawn in drawings(bend, 20)]
        off = np.array([np.abs(guess.bends - bends) for guess, bends in true])
        assert off.mean() < most_off
        assert 0.6 < (off / [guess.scales for guess, _ in true]).mean() < 1.4

    def test_turned_drawings_are_read_alike(self, network):
        [drawn] = drawings(1.5, 1)
        upright, turned = (network.read(np.ascontiguousarray(each)) for each in (drawn.picture, drawn.picture.T))
        # A transposition is symmetry 5.
        expected = turn_bends(torch.from_numpy(upright.bends), 5).numpy()
        np.testing.assert_allclose(turned.bends, expected, atol=1e-3)

    def test_strongly_bent_drawings_are_registered(self, network):
        drawn = drawings(1.5, 10)
        before, now = (
            np.mean([misread(register(each.picture, SIZE, guess(each.picture)), each) for each in drawn])
            for guess in (lambda picture: None, network.read)
        )
        assert now < 0.06
        assert before > 2 * now

    @pytest.mark.parametrize("kind", [*KNOWN, *NOVEL])
    def test_maps_that_are_not_bent_are_read_right(self, network, kind):
        walls = generate(kind, SIZE, np.random.default_rng(0)).walls
        picture = np.kron(walls, np.ones((2, 2))).astype(np.float32)
        np.testing.assert_array_equal(register(picture, SIZE, network.read(picture)).walls > 0.5, walls)

    def test_a_sheet_without_a_maze_gives_distributions(self, network):
        for value in (0.4, 1.0):
            context = np.full((4, 2 * SIZE, 2 * SIZE), value, np.float32)
            for distribution in read_map(context, SIZE, network.read)[1:]:
                assert distribution.sum() == pytest.approx(1)
                assert distribution.min() >= 0

    def test_a_picture_is_read_alike_whatever_was_read_before(self, network):
        first, second = drawings(1.5, 2)
        before, _, after = (network.read(each.picture) for each in (first, second, first))
        np.testing.assert_array_equal(before.bends, after.bends)
        np.testing.assert_array_equal(before.scales, after.scales)


def test_a_certain_guess_that_is_right_leaves_no_cell_misread():
    for drawn in drawings(1.5, 3):
        guess = Guess(PLACES, true_bends(drawn).astype(float), np.full((2, 32, 32), 0.02))
        assert misread(register(drawn.picture, SIZE, guess), drawn) < 0.01


class TestWithoutIt:
    @pytest.fixture
    def rough(self):
        return Task.of("rough", level=3).interface

    @pytest.mark.parametrize("missing", ["map-bends.safetensors", "torch"])
    def test_maps_are_registered_as_without_a_guess_and_a_line_says_so(self, monkeypatch, tmp_path, rough, missing):
        if missing == "torch":
            monkeypatch.setattr(map_reading.importlib.util, "find_spec", lambda name: None if name == "torch" else name)
        else:
            monkeypatch.setattr(map_reading, "BENDS", tmp_path / missing)
        with pytest.warns(Remark, match=f"without {missing}, robots read drawn maps less well"):
            senses = Navigator.build(rough)._senses
        [drawn] = drawings(1.0, 1)
        found = read_map(context_of(drawn), SIZE, senses._guess).walls
        np.testing.assert_array_equal(found, register(drawn.picture, SIZE).walls)

    def test_maps_that_are_not_drawn_need_none(self):
        for options in ({"task": "building"}, {"task": "rough", "hide": ("map",)}, {"task": "local"}):
            assert map_reader(Task.of(**options).interface) is None

    def test_a_damaged_file_is_refused(self, tmp_path):
        (tmp_path / "bends.safetensors").write_bytes(BENDS.read_bytes()[:1000])
        with pytest.raises(InputError, match="expected a checkpoint of mazebench-agent-1, found"):
            load(tmp_path / "bends.safetensors")


class TestResults:
    def play(self, out, task="rough", **options):
        mazes = {"kinds": ("dfs",), "num_mazes": 1, "split": "dev", "distances": (15,), "episodes_per_distance": 1}
        return mazebench.evaluate("navigator", task, out=out, level=1, **mazes, **options)

    def test_have_the_hash_of_the_network_where_a_drawn_map_is_read(self, tmp_path):
        expected = hashlib.sha256(BENDS.read_bytes()).hexdigest()
        assert self.play(tmp_path / "rough").provenance.map_reader_sha256 == expected
        for name, options in {"building": {"task": "building"}, "hidden": {"hide": ("map",)}}.items():
            self.play(tmp_path / name, **options)
            written = json.loads((tmp_path / name / "summary.json").read_text())
            assert "map_reader_sha256" not in written["provenance"]

    def test_are_not_gone_on_with_by_another_network(self, tmp_path, monkeypatch):
        self.play(tmp_path / "run")
        other = tmp_path / "map-bends.safetensors"
        other.write_bytes(BENDS.read_bytes() + b" ")
        monkeypatch.setattr(map_reading, "BENDS", other)
        with pytest.raises(InputError, match="holds another run: its map_reader_sha256 is"):
            self.play(tmp_path / "run", resume=True)
