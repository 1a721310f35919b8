"""The paper's printed figures beside ours."""

import pytest
from made_results import PROVENANCE

from mazebench.commands.summary_table import print_summary
from mazebench.results.paper import printed, printed_mmn
from mazebench.results.records import Summary
from mazebench.tasks.task import Task


def a_summary(privileged: bool = False, **options) -> Summary:
    figures = {"n": 4, "success_rate": 1.0, "spl": 0.9, "spl_grid": 0.95}
    figures |= {f"{name}_ci95": (0.5, 1.0) for name in ("success_rate", "spl", "spl_grid")}
    figures |= {"on_time": {"2": 1.0}, "on_time_ci95": {"2": (0.5, 1.0)}}
    task = Task.of(**{"split": "eval"} | options).options
    defaults = {"agent": "mmn", "task": task, "benchmark": "paper", "episodes": 4, "provenance": PROVENANCE}
    return Summary(**defaults, privileged=privileged, overall=figures, by_distance={"2": figures, "3": figures})


def test_printed_figures_are_those_of_the_papers_tables():
    assert printed("local", 13)["MMN"]["success_rate"] == {2: 0.91, 4: 0.90, 6: 0.71, 8: 0.58, 10: 0.43}
    assert printed("hierarchical", 13)["MAH"]["success_rate"] == {5: 0.45}
    assert printed("local", 15) == {}


@pytest.mark.parametrize("values", [{"split": "train"}, {"size": 15}, {"map_flip": 0.1}])
def test_the_papers_figures_stand_only_beside_what_can_be_held_against_them(values):
    assert printed_mmn(a_summary(**values)) == {}


@pytest.mark.parametrize(("task", "figure"), [("local", "0.91"), ("hierarchical", "0.80")])
def test_a_summary_shows_the_papers_figure(capsys, task, figure):
    print_summary(a_summary(task=task))
    output = capsys.readouterr().out
    assert figure in output
    assert "the paper's MMN" in output


def test_a_summary_of_other_landmarks_shows_no_figure_and_a_privileged_agent_is_labelled(capsys):
    print_summary(a_summary(task="hierarchical", landmark_distance=3, privileged=True))
    output = capsys.readouterr().out
    assert "0.80" not in output
    assert "mmn (privileged): hierarchical, eval mazes 13 x 13" in output
