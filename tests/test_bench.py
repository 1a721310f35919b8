"""The speeds of `mazebench bench`: that they can be measured, not what they are."""

from __future__ import annotations

from mazebench.bench import environments, measure, pictures, sizes, with_pictures


def test_speeds_are_measured_as_ratios_to_the_first():
    first, *others = measure(environments((1, 2)), seconds=0.01, rounds=1)
    assert (first["name"], first["ratio"]) == ("bare MuJoCo loop", 1.0)
    assert {"Gymnasium", "Gymnasium, rebuilt", "vector, 1", "vector, 2", "vector, 2, 1 thread", "vector, 2, lidar"} <= {
        row["name"] for row in others
    }
    assert all(row["steps/s"] > 0 and row["ratio"] > 0 for row in others)


def test_mazes_of_several_sizes_are_measured():
    rows = measure(sizes((13, 15), num_envs=2), seconds=0.01, rounds=1)
    assert [row["name"] for row in rows] == ["13 x 13", "15 x 15"]


def test_pictures_are_measured_in_environments_and_alone():
    rows = measure([*with_pictures(num_envs=2), *pictures((5,), (8,))], seconds=0.01, rounds=1)
    assert {"no picture", "varied", "plain, 8 pixels, 5 x 5"} <= {row["name"] for row in rows}
