"""Configs of the learning agents: every key has its reason, and a value that can't be met is refused."""

import ast
import dataclasses
import inspect
import re

import pytest
from mazebench_agents.common.overrides import override
from mazebench_agents.dqn import config as dqn
from mazebench_agents.mmn import config as mmn

from mazebench.errors import InputError

CONFIGS = [(dqn, [dqn.DQNConfig]), (mmn, [mmn.MMNConfig, mmn.PaperConfig])]


@pytest.mark.parametrize(("module", "configs"), CONFIGS)
def test_every_config_key_has_a_comment_with_its_reason(module, configs):
    source = inspect.getsource(module)
    fields = {field.name for config in configs for field in dataclasses.fields(config)}
    assert {node.target.id for node in ast.walk(ast.parse(source)) if isinstance(node, ast.AnnAssign)} == fields
    for name in fields:
        assert re.search(rf"^    {name}: .*  # .+", source, re.MULTILINE), name


@pytest.mark.parametrize(("module", "configs"), CONFIGS)
def test_every_number_of_a_config_has_a_range(module, configs):
    fields = [field for config in configs for field in dataclasses.fields(config)]
    numbers = {field.name for field in fields if field.type in ("int", "float")}
    assert set(module._RANGES) == numbers


@pytest.mark.parametrize(
    ("config", "values", "message"),
    [
        (dqn.DQNConfig, {"colour": "red"}, "unknown config key 'colour'; available: channels"),
        (dqn.DQNConfig, {"hidden": "many"}, "config key 'hidden': expected int, found 'many'"),
        (dqn.DQNConfig, {"symmetries": "perhaps"}, "config key 'symmetries': expected bool"),
        (dqn.DQNConfig, {"num_envs": "0"}, "expected config key 'num_envs' from 1"),
        (dqn.DQNConfig, {"learning_rate": "nan"}, "config key 'learning_rate': expected a finite number, found nan"),
        (dqn.DQNConfig, {"replay_capacity": "1000"}, "expected a replay_capacity of at least min_rows 20000"),
        (mmn.MMNConfig, {"search": "alpha"}, "'search' as one of gumbel, puct, found 'alpha'"),
        (mmn.PaperConfig, {"num_distances": "2"}, "unknown config key 'num_distances'"),
        (mmn.MMNConfig, {"temperature": "0"}, "expected config key 'temperature' from 0.001"),
        (mmn.MMNConfig, {"unroll": "9"}, "expected sequence_steps of at least unroll 9, found 8"),
    ],
)
def test_a_key_or_value_that_is_not_allowed_is_refused(config, values, message):
    with pytest.raises(InputError, match=message):
        override(config(), values)


def test_overrides_turn_text_into_the_fields_types():
    config = override(dqn.DQNConfig(), {"hidden": "64", "symmetries": "false", "learning_rate": "1e-3"})
    assert (config.hidden, config.symmetries, config.learning_rate) == (64, False, 1e-3)
