"""Configs of the learning agents: a key or value that is not allowed is refused."""

import pytest
from mazebench_agents.dqn.dqn_config import DQNConfig
from mazebench_agents.mmn.mmn_config import MMNConfig

from mazebench.errors import InputError
from mazebench.options import override


@pytest.mark.parametrize(
    ("config", "values", "message"),
    [
        (DQNConfig, {"colour": "red"}, "unknown config key 'colour'; available: channels"),
        (DQNConfig, {"hidden": "many"}, "config key 'hidden': expected int, found 'many'"),
        (DQNConfig, {"symmetries": "perhaps"}, "config key 'symmetries': expected bool"),
        (DQNConfig, {"num_envs": "0"}, "config: expected num_envs from 1 to 65536, found 0"),
        (DQNConfig, {"learning_rate": "nan"}, "config: expected learning_rate as a finite number, found nan"),
        (DQNConfig, {"replay_capacity": "1000"}, "expected a replay_capacity of at least min_rows 20000"),
        (MMNConfig, {"num_distances": "2"}, "unknown config key 'num_distances'"),
        (MMNConfig, {"unroll": "11"}, "expected sequence_steps of at least unroll 11, found 10"),
    ],
)
def test_a_key_or_value_that_is_not_allowed_is_refused(config, values, message):
    with pytest.raises(InputError, match=message):
        override(config(), values)


def test_overrides_turn_text_into_the_fields_types():
    config = override(DQNConfig(), {"hidden": "64", "symmetries": "false", "learning_rate": "1e-3"})
    assert (config.hidden, config.symmetries, config.learning_rate) == (64, False, 1e-3)
