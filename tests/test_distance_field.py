"""Features of the distances around the body, on a map by hand."""

from __future__ import annotations

import numpy as np
import pytest
from mazebench_agents.integrations.distance_field import DistanceField

MAP = """
.....
.###.
.#G#.
.#.#.
.....
"""


def observe(x, y, yaw=0.0):
    """One observation at rest on the map above, whose cells are 1 m wide."""
    cells = np.array([list(line) for line in MAP.split()])
    context = np.stack([cells == "#", np.zeros((5, 5)), cells == "G", np.zeros((5, 5))]).astype(np.float32)
    state = np.zeros((1, 12), np.float32)
    state[0, [0, 1, 5]] = x, y, yaw
    return {"state": state, "context": context[None], "lidar": np.full((1, 4), 2.5, np.float32)}


def features(observation, **options):
    field = DistanceField(1, points=3, **options)
    field.read(observation["context"], np.array([True]))
    return field.features(observation)[0]


def test_distances_on_the_map_around_the_body():
    # In the middle of the cell below the goal's corridor, looking up the map: the goal is 2 m of way from here.
    found = features(observe(2.5, 0.5, np.pi / 2))
    behind, beside, ahead = found[:9].reshape(3, 3) * 6
    assert behind.tolist() == [6, 6, 6]  # outside of the map is as far as it gets
    assert beside == pytest.approx([1, 0, 1])
    assert ahead == pytest.approx([6, -1, 6])  # walls beside the corridor
    assert found[9:] == pytest.approx([2 / 40, 0, 0, 1, 0, 0, 0, 0, *[0.5] * 4], abs=1e-6)


def test_offset_in_the_cell_is_in_the_bodys_frame():
    # .25 m to the right of the cell's centre on the map is .25 m to the right of a body that looks up.
    assert features(observe(2.75, 0.5, np.pi / 2))[10:12] == pytest.approx([0, -0.25], abs=1e-6)


def test_a_map_of_finer_pixels_has_the_same_distances():
    observation = observe(2.25, 0.25, np.pi / 2)
    fine = observation | {"context": observation["context"].repeat(2, axis=2).repeat(2, axis=3)}
    # The goal's marker is the first of its four pixels, at (2.25, 2.75) m.
    fine["context"][0, 2] = 0
    fine["context"][0, 2, 4, 4] = 1
    assert features(fine, pixel=0.5)[9] == pytest.approx(2.5 / 40)


def test_maps_are_read_where_they_are_new():
    observation = observe(2.5, 0.5)
    field = DistanceField(2, points=3)
    both = {name: values.repeat(2, axis=0) for name, values in observation.items()}
    field.read(both["context"], np.array([True, True]))
    before = field.features(both)
    both["context"][:, 0] = 0  # no walls
    field.read(both["context"], np.array([False, True]))
    after = field.features(both)
    np.testing.assert_array_equal(before[0], after[0])
    assert (before[1] != after[1]).any()
    np.testing.assert_array_equal(field.features(observation, np.array([1]))[0], after[1])
