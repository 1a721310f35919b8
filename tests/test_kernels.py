"""Where the machine code of kernels is kept."""

import importlib
import os
import sys

import numba
import pytest

from mazebench import kernels


@pytest.fixture
def users_cache(tmp_path, monkeypatch):
    """The user's cache, where no other is chosen."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "mazebench"


@pytest.fixture
def file(tmp_path):
    """A regular file: nobody can write below it."""
    (tmp_path / "file").touch()
    return tmp_path / "file"


class TestCacheFolder:
    def test_it_is_beside_the_kernels_if_that_can_be_written(self, users_cache, tmp_path):
        assert kernels.cache_folder(tmp_path / "package", "12") == tmp_path / "package" / "kernels-12"

    def test_it_is_in_the_users_cache_if_not(self, users_cache, file):
        assert kernels.cache_folder(file, "12") == users_cache / "kernels-12"

    def test_it_is_where_numba_is_told_to_keep_its_cache(self, users_cache, tmp_path, monkeypatch):
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "numba"))
        assert kernels.cache_folder(tmp_path / "package", "34") == tmp_path / "numba" / "kernels-34"

    def test_a_line_says_that_each_start_compiles_if_none_can_be_written(self, users_cache, file, monkeypatch, remarks):
        monkeypatch.setenv("XDG_CACHE_HOME", str(file))
        assert kernels.cache_folder(file, "56") is None
        (line,) = remarks()
        assert "each start compiles" in line

    def test_machine_code_that_was_long_not_used_is_deleted(self, users_cache, tmp_path):
        old, recent, others = (tmp_path / f"kernels-{name}" for name in (16 * "0", 16 * "1", "of-linux"))
        for folder in (old, recent, others):
            (folder / "robot").mkdir(parents=True)
        for folder in (old, others):
            os.utime(folder, (0, 0))
        kernels.cache_folder(tmp_path, 16 * "2")
        assert not old.exists()
        assert recent.exists()
        assert others.exists(), "a folder that is no machine code"


def test_a_kernel_follows_a_change_of_what_it_uses(users_cache, tmp_path, monkeypatch):
    package = tmp_path / "arithmetic"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "__pycache__").touch()  # so that no folder of this name can be written to
    (package / "doubled.py").write_text(
        "from mazebench.kernels import compiled\n"
        "from arithmetic.factors import FACTOR\n\n\n"
        "@compiled\n"
        "def doubled(x):\n"
        "    return FACTOR * x\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for factor in (2, 2, 3):
        (package / "factors.py").write_text(f"FACTOR = {factor}\n")
        for name in [name for name in sys.modules if name.startswith("arithmetic")]:
            monkeypatch.delitem(sys.modules, name)
        kernels._digest.cache_clear()
        importlib.invalidate_caches()
        kernel = importlib.import_module("arithmetic.doubled").doubled
        assert kernel(5) == factor * 5
    assert len(list(users_cache.glob("kernels-*"))) == 2
