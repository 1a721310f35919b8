"""The public names of mazebench: each has an example in its docstring, and those that need no files run."""

from __future__ import annotations

import doctest
import inspect

import numpy as np
import pytest

import mazebench

NEED_FILES_OR_TIME = {
    "Agent",
    "Inputs",
    "SingleAgent",
    "UnplayableError",
    "evaluate",
    "read_maze",
    "read_mazes",
    "train",
}


@pytest.mark.parametrize("name", mazebench.__all__)
def test_every_public_name_has_an_example(name):
    assert ">>> " in inspect.getdoc(getattr(mazebench, name))


@pytest.mark.parametrize("name", sorted({*mazebench.__all__} - NEED_FILES_OR_TIME))
@pytest.mark.filterwarnings("ignore::mazebench.errors.Remark")
def test_an_example_prints_what_it_shows(name):
    if name == "load":
        pytest.importorskip("dm_control")
    names = {"mazebench": mazebench, "np": np}
    text = inspect.getdoc(getattr(mazebench, name))
    test = doctest.DocTestParser().get_doctest(text, names, name, None, None)
    printed: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
    assert runner.run(test, out=printed.append).failed == 0, "".join(printed)
