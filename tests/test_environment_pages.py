"""The pages docs/environments; `python tests/test_environment_pages.py` rewrites them from the code."""

from __future__ import annotations

import pathlib
import textwrap

import gymnasium
import pytest

import mazebench
from mazebench.constants import ACTIONS
from mazebench.options import fields_of
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import LEVELS, TRACKS

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "environments"
TASKS = {
    "local": "Drive from a start to a goal 1 to 15 cells away, in depth-first mazes of 13 x 13 to 21 x 21 cells: the "
    "paper's protocol. The map is exact unless perturbations are asked for.",
    "hierarchical": "Drive from corner to corner over landmarks on a shortest path, in the same mazes. Each landmark "
    "begins a new context.",
}
CHOICE = {  # question: environment
    "learn to drive by a right map, first steps in RL": "building",
    "plan although the map is out of date": "rebuilt",
    "localize by odometry and a map": "adrift",
    "read a sketch": "rough",
    "compare with the paper, short training without a lidar": "local",
    "follow sub-goals of a given path": "hierarchical",
}
_OPTIONS = {
    "local": ("size", "distances", "num_goals", "map_flip", "map_warp", "position_noise", "sensors", "time_limit"),
    "hierarchical": ("size", "landmark_distance", "map_flip", "map_warp", "position_noise", "sensors", "time_limit"),
}
_OF_TRACKS = ("level", "split", "kinds", "fresh", "distances", "actions", "hide", "exact_pose", "reward")


def pages() -> dict[str, str]:
    """Returns the text of each page by its file's name."""
    names = [*TRACKS, *TASKS]
    return {"index.md": _index(names)} | {f"{name}.md": _page(name) for name in names}


def _index(names: list[str]) -> str:
    cards = [
        f"| [![{name}](../images/environments/{name}.png)]({name}.md) | [{name}]({name}.md) | {_help(name)} |"
        for name in names
    ]
    return "\n".join(
        [
            "# Environments\n",
            "All environments have the same body, actions and observation ([The task](../task.md)).\n",
            "| | | |",
            "|---|---|---|",
            *cards,
            "\n## Which environment should I use?\n",
            "| you want to | environment |",
            "|---|---|",
            *(f"| {question} | [{name}]({name}.md) |" for question, name in CHOICE.items()),
            "",
        ]
    )


def _page(name: str) -> str:
    task = Task.of(name)
    observed = {"state": (12,), "context": (4, task.context_size, task.context_size)}
    observed |= {"lidar": (32,)} if "lidar" in task.sensors else {}
    options = ", level=2" if name in TRACKS else ""
    limit = (
        "6 steps a cell and more, by the distance"
        if name in TRACKS
        else f"{task.options.time_limit} steps for each goal"
    )
    sections = [
        f"# {name}\n",
        f"![{name}](../images/environments/{name}.png)\n",
        textwrap.fill(_help(name), 120) + "\n",
        "```python",
        "import gymnasium",
        "import mazebench\n",
        f'env = gymnasium.make("{_ids(name)[0]}"{options})',
        f'envs = mazebench.make_vec("{name}", 8{options})',
        f'env = mazebench.load("{name}"{options})  # dm_control',
        "```\n",
        "| | |",
        "|---|---|",
        f"| ids | {', '.join(f'`{each}`' for each in _ids(name))} |",
        f"| actions | `Discrete({len(ACTIONS)})`: {', '.join(each.replace('_', ' ') for each in ACTIONS)} |",
        f"| observations | {', '.join(f'`{key}` `{list(shape)}`' for key, shape in observed.items())}, float32 |",
        "| reward | -1 a step, 0 for the step that reaches the goal |",
        "| start | the centre of a free cell, a random heading |",
        f"| end | the goal cell is reached, or the time is up: {limit} |",
        "| version | 1: first release |\n",
        *(_levels(name) if name in TRACKS else ()),
        "## Arguments\n",
        "| option | default | meaning |",
        "|---|---|---|",
        *(
            f"| `{each}` | `{fields_of(TaskOptions)[each].default!r}` | {fields_of(TaskOptions)[each].help} |"
            for each in (_OF_TRACKS if name in TRACKS else _OPTIONS[name])
        ),
        "\n[Options](../options.md) lists all of them.",
        "",
    ]
    return "\n".join(sections)


def _levels(name: str) -> list[str]:
    track = TRACKS[name]
    lines = [f"| {level} | {track.levels[level - 1].meaning} |" for level in LEVELS]
    pose = "odometry from (0, 0, 0) at the first step" if track.hides_pose else "exact"
    return [
        "## Levels\n",
        "| level | what is imperfect |",
        "|---|---|",
        *lines,
        f"\nThe pose in `state` is {pose}. The lidar is a TurtleBot3's.\n",
    ]


def _help(name: str) -> str:
    return TRACKS[name].help if name in TRACKS else TASKS[name]


def _ids(name: str) -> list[str]:
    return [
        each for each in gymnasium.registry if each.lower().startswith((f"mazebench/{name}-", f"mazebench/{name}goal-"))
    ]


@pytest.mark.parametrize("name", list(pages()))
def test_a_page_follows_from_the_code(name):
    page = (FOLDER / name).read_text(encoding="utf-8")
    assert page == pages()[name], "python tests/test_environment_pages.py rewrites it"


def test_observations_are_those_of_the_environments():
    for name in (*TRACKS, *TASKS):
        space, page = mazebench.make(name).observation_space, pages()[f"{name}.md"]
        assert all(f"`{key}` `{list(box.shape)}`" in page for key, box in space.spaces.items() if key != "is_first")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for file_name, text in pages().items():
        (FOLDER / file_name).write_text(text, encoding="utf-8")
