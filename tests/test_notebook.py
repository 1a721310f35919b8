"""The notebook of docs: small, of legal cells, and all of them run in order."""

from __future__ import annotations

import json
import pathlib

import pytest
from processes import run_python

NOTEBOOK = pathlib.Path(__file__).parent.parent / "docs" / "examples" / "first_hour.ipynb"
SMALL_BUDGET = {"STEPS = 40_000": "STEPS = 4_000", "range(15, 41)": "range(15, 17)"}


@pytest.fixture(scope="module")
def notebook() -> dict:
    return json.loads(NOTEBOOK.read_text(encoding="utf-8"))


def code_of(notebook: dict) -> str:
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return "\n\n".join(cells)


def test_it_stays_small_and_every_cell_has_an_id(notebook):
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    ids = [cell["id"] for cell in notebook["cells"]]
    assert len(set(ids)) == len(ids)
    assert NOTEBOOK.stat().st_size < 150_000


def test_its_outputs_are_those_of_a_run_from_top_to_bottom(notebook):
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert not any(output["output_type"] == "error" for cell in cells for output in cell["outputs"])


@pytest.mark.slow
def test_all_cells_run_with_a_small_budget(notebook, tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("matplotlib")
    code = code_of(notebook)
    for shown, small in SMALL_BUDGET.items():
        assert shown in code
        code = code.replace(shown, small)
    (tmp_path / "cells.py").write_text(code, encoding="utf-8")
    printed = run_python("cells.py", cwd=tmp_path, variables={"MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"}).stdout
    assert all(f"\n{name} " in printed for name in ("mine", "ships", "navigator", "without-map"))
    assert (tmp_path / "report" / "report.html").exists()
