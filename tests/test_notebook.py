"""The notebook of docs: its cells run in order."""

from __future__ import annotations

import json
import pathlib

import pytest
from processes import run_python

NOTEBOOK = pathlib.Path(__file__).parent.parent / "docs" / "examples" / "first_hour.ipynb"
SMALL_BUDGET = {"STEPS = 40_000": "STEPS = 4_000", "range(15, 41)": "range(15, 17)"}


@pytest.mark.slow
def test_all_cells_run_with_a_small_budget(tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("matplotlib")
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    for shown, small in SMALL_BUDGET.items():
        assert shown in code
        code = code.replace(shown, small)
    (tmp_path / "cells.py").write_text(code, encoding="utf-8")
    printed = run_python("cells.py", cwd=tmp_path, variables={"MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"}).stdout
    assert all(f"\n{name} " in printed for name in ("mine", "ships", "navigator", "without-map"))
    assert (tmp_path / "report" / "report.html").exists()
