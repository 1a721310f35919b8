"""Configs of the learning agents: every key has its reason, and a value that can't be met is refused."""

import inspect
import re

import pytest
from mazebench_agents.common.overrides import override
from mazebench_agents.dqn.config import DQNConfig
from mazebench_agents.mmn.config import MMNConfig

from mazebench.errors import InputError
from mazebench.options import fields_of

OF_ALL = pytest.mark.parametrize("config", [DQNConfig, MMNConfig])


@OF_ALL
def test_every_config_key_has_a_comment_with_its_reason(config):
    source = inspect.getsource(config)
    for name in vars(config)["__annotations__"]:
        assert re.search(rf"^    {name}: .*  # .+", source, re.MULTILINE), name


@OF_ALL
def test_every_number_of_a_config_has_a_range(config):
    for name, field in fields_of(config).items():
        assert field.kind not in (int, float) or field.range_text, name


@pytest.mark.parametrize(
    ("config", "values", "message"),
    [
        (DQNConfig, {"colour": "red"}, "unknown config key 'colour'; available: channels"),
        (DQNConfig, {"hidden": "many"}, "config key 'hidden': expected int, found 'many'"),
        (DQNConfig, {"symmetries": "perhaps"}, "config key 'symmetries': expected bool"),
        (DQNConfig, {"num_envs": "0"}, "config: expected num_envs from 1 to 65536, found 0"),
        (DQNConfig, {"learning_rate": "nan"}, "config: expected learning_rate as a finite number, found nan"),
        (DQNConfig, {"replay_capacity": "1000"}, "expected a replay_capacity of at least min_rows 20000"),
        (MMNConfig, {"search": "alpha"}, "config: unknown search 'alpha'; available: gumbel, puct"),
        (MMNConfig, {"num_distances": "2"}, "unknown config key 'num_distances'"),
        (MMNConfig, {"temperature": "0"}, "config: expected temperature of at least 0.001, found 0"),
        (MMNConfig, {"unroll": "11"}, "expected sequence_steps of at least unroll 11, found 10"),
    ],
)
def test_a_key_or_value_that_is_not_allowed_is_refused(config, values, message):
    with pytest.raises(InputError, match=message):
        override(config(), values)


def test_overrides_turn_text_into_the_fields_types():
    config = override(DQNConfig(), {"hidden": "64", "symmetries": "false", "learning_rate": "1e-3"})
    assert (config.hidden, config.symmetries, config.learning_rate) == (64, False, 1e-3)
