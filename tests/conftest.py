"""Fixtures of several test modules."""

from __future__ import annotations

import gc
import os
import pathlib
import sys
import warnings
from collections.abc import Callable, Iterator

os.environ.setdefault("OMP_NUM_THREADS", "1")  # of each worker of pytest-xdist and its processes; read by imports below
os.environ.setdefault("MAZEBENCH_NO_CACHE", "1")  # no test reads what another run has kept

import numpy as np
import pytest

from mazebench.errors import Remark

gc.disable()  # while tests are imported, which leaves no garbage


def pytest_collection_finish() -> None:
    """Has later collections of garbage pass over what was imported."""
    gc.freeze()
    gc.enable()


# Fixtures import what the process that only hands out tests to workers can do without.


@pytest.fixture(scope="session", autouse=True)
def kernels() -> None:
    """The kernels of shortest paths are compiled, of which a line on standard error would tell."""
    from mazebench.maps.geodesic import length_between
    from mazebench.maps.kinds import generate

    length_between(generate("dfs", 7, np.random.default_rng(0)), 0.15, (1, 1), (5, 5))


@pytest.fixture
def command(tmp_path, monkeypatch, capsys) -> Callable[..., tuple[int, str, str]]:
    """Runs a command in this process, in an empty working directory; gives exit status, output and errors."""
    from mazebench import cli

    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | pathlib.Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["mazebench", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            cli.main()
        return caught.value.code, *capsys.readouterr()

    return run


@pytest.fixture
def remarks() -> Iterator[Callable[[], list[str]]]:
    """A function that returns the remarks since its last call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Remark)

        def since_last_call() -> list[str]:
            lines = [str(warning.message) for warning in caught if issubclass(warning.category, Remark)]
            caught.clear()
            return lines

        yield since_last_call


@pytest.fixture(scope="session")
def planner_run(tmp_path_factory) -> pathlib.Path:
    """The folder of an evaluation of a few episodes, which no test changes."""
    from run_folders import FEW

    from mazebench.evaluation.evaluate import evaluate

    folder = tmp_path_factory.mktemp("runs") / "planner"
    evaluate("planner", out=folder, **FEW)
    return folder


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> pathlib.Path:
    """The folder of the results that `make_results` makes."""
    from made_results import make_results

    return make_results(tmp_path_factory.mktemp("made") / "results")


@pytest.fixture(scope="session")
def report(made, tmp_path_factory) -> pathlib.Path:
    """The report over them."""
    from mazebench.report.write_report import write_report  # matplotlib takes a while to load

    out = tmp_path_factory.mktemp("report")
    write_report([made], out)
    return out
