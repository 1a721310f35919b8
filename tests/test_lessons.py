import sys

import pytest
from mazebench_agents.common.checkpoint import load_checkpoint
from mazebench_agents.common.lessons import Training, main
from mazebench_agents.neural_mapper.scan_training import ScanLessons
from mazebench_agents.robot.bend_training import BendLessons
from mazebench_agents.robot.change_training import ChangeLessons

from mazebench.errors import InputError


@pytest.mark.parametrize("lessons", [BendLessons, ChangeLessons, ScanLessons])
def test_training_lowers_the_loss_and_goes_on_where_it_was(lessons, monkeypatch):
    monkeypatch.setattr(lessons, "first", 64, raising=False)
    training = Training(lessons, num_updates=10, seed=0)
    [(_, first)] = training.run()
    again = Training(lessons, num_updates=30, seed=0, tensors=training.tensors())
    [(num_updates, last)] = again.run()
    assert num_updates == 30
    assert last < first
    assert isinstance(again.network, type(training.network))


def test_the_program_writes_a_network_and_goes_on_with_it(tmp_path, monkeypatch, capsys):
    out = tmp_path / "scan.safetensors"
    for updates, options in ((1, ()), (2, ("--resume",))):
        monkeypatch.setattr(sys, "argv", ["x", "--updates", str(updates), "--out", str(out), *options])
        main(ScanLessons, "Trains.")
    assert load_checkpoint(out, "scan-walls")[1]["updates"] == 2
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["1", "2"]
    with pytest.raises(InputError, match="scan-walls"):
        load_checkpoint(out, "map-bends")
