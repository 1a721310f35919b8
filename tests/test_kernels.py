"""Where the machine code of kernels is kept."""

import importlib
import sys

import numba
import pytest

from mazebench import kernels


@pytest.fixture
def users_cache(tmp_path, monkeypatch):
    """The user's cache, where no other is chosen."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "mazebench"


@pytest.fixture
def file(tmp_path):
    """A regular file: nobody can write below it."""
    (tmp_path / "file").touch()
    return tmp_path / "file"


class TestCacheFolder:
    def test_it_is_beside_the_kernels_or_in_the_users_cache_or_where_numba_is_told_to(
        self, users_cache, file, tmp_path, monkeypatch
    ):
        assert kernels.cache_folder(tmp_path, "12") == tmp_path / "kernels-12"
        assert kernels.cache_folder(file, "12") == users_cache / "kernels-12"
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "from .numba_config.yaml"))
        assert kernels.cache_folder.__wrapped__(tmp_path, "12") == tmp_path / "kernels-12"
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
        assert kernels.cache_folder(tmp_path, "34") == tmp_path / "numba" / "kernels-34"

    def test_a_line_says_that_each_start_compiles_if_none_can_be_written(self, users_cache, file, monkeypatch, remarks):
        monkeypatch.setenv("XDG_CACHE_HOME", str(file))
        assert kernels.cache_folder(file, "56") is None
        (line,) = remarks()
        assert "each start compiles" in line


def test_a_kernel_follows_a_change_of_what_it_uses(users_cache, tmp_path, monkeypatch):
    package = tmp_path / "arithmetic"
    package.mkdir()
    (package / "__pycache__").touch()  # so that no folder of this name can be written to
    texts = {"__init__": "", "kernel": "from mazebench.kernels import compiled\nfrom arithmetic.factor import FACTOR\n"}
    texts["kernel"] += "@compiled\ndef multiplied(x): return FACTOR * x\n"
    monkeypatch.syspath_prepend(tmp_path)
    for factor in (2, 2, 3):
        for name, text in (texts | {"factor": f"FACTOR = {factor}"}).items():
            (package / f"{name}.py").write_text(text)
            monkeypatch.delitem(sys.modules, f"arithmetic.{name}", raising=False)
        kernels._digest.cache_clear()
        importlib.invalidate_caches()
        assert importlib.import_module("arithmetic.kernel").multiplied(5) == factor * 5
    assert len(list(users_cache.glob("kernels-*"))) == 2
