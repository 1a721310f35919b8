"""The notebook of docs: its cells run in order, and all of it is on its page."""

from __future__ import annotations

import importlib.util
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


def test_the_page_of_the_site_has_all_cells_and_what_they_print_and_draw():
    pytest.importorskip("mkdocs")
    spec = importlib.util.spec_from_file_location("site_build", NOTEBOOK.parent.parent / "site_build.py")
    site_build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(site_build)
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    page, pictures = site_build.notebook_page(notebook, "first_hour")
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    texts = [
        "".join(each)
        for each in (*(cell["source"] for cell in notebook["cells"]), *(o.get("text", "") for o in outputs))
    ]
    assert page.startswith("# The first hour with mazebench\n")
    assert all("".join(text).rstrip() in page for text in texts)
    assert len(pictures) == sum("image/png" in output.get("data", ()) for output in outputs) > 0
    assert all(content.startswith(b"\x89PNG") and f"]({name})" in page for name, content in pictures.items())
