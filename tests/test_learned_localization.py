"""The learned observation model: what it is taught, and the agent that uses it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import mazebench
from benchmarks import learned_localization
from mazebench.errors import InputError

FEW = {"kinds": ("dfs",), "num_mazes": 1, "distances": (15, 20)}


class TestWindow:
    def test_a_window_has_the_cell_in_its_middle_and_the_outside_around_the_plane(self):
        plane = np.arange(9.0).reshape(3, 3)
        found = learned_localization.window(plane, 0, 2, outside=-1.0)
        half = learned_localization.HALF
        assert found[half, half] == 2.0
        assert found[half + 2, half] == 8.0
        assert found[half - 1, half] == found[half, half + 1] == -1.0

    def test_far_outside_there_is_nothing_else(self):
        assert (learned_localization.window(np.zeros((3, 3)), 50, -50, outside=1.0) == 1.0).all()


@pytest.mark.parametrize(("track", "level"), learned_localization.SETTINGS)
def test_training_finds_the_true_placement(track, level):
    samples = learned_localization.collect(track, level, **FEW)
    assert len(samples) == len(FEW["distances"])
    model = learned_localization.train(samples, 60, seed=0)
    for sample in samples:
        first, last = sample.log_posteriors(model)[[0, -1], sample.truth].exp().tolist()
        assert last > max(first, 0.8)


def test_the_agent_plays_by_the_model_of_its_file(tmp_path):
    torch.manual_seed(0)
    path = tmp_path / "model.pt"
    torch.save(learned_localization.Model().state_dict(), path)
    options = {"level": 3, "split": "dev", "episodes_per_distance": 1} | FEW
    summary = mazebench.evaluate(learned_localization.LearnedNavigator, "building", checkpoint=path, **options)
    assert summary.episodes == len(FEW["distances"])
    with pytest.raises(InputError, match="expected --checkpoint"):
        mazebench.evaluate(learned_localization.LearnedNavigator, "building", **options)
