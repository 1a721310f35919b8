"""Configs of the learning agents: every key has its reason, and a value that can't be met is refused."""

import dataclasses
import inspect
import re

import pytest
from mazebench_agents.belief_planner.config import BeliefPlannerConfig
from mazebench_agents.common.overrides import override
from mazebench_agents.dqn import config as dqn
from mazebench_agents.mmn.config import MMNConfig
from mazebench_agents.muzero.config import MuZeroConfig

from mazebench.errors import InputError

OF_ALL = pytest.mark.parametrize("config", [dqn.DQNConfig, MuZeroConfig, MMNConfig, BeliefPlannerConfig])


@OF_ALL
def test_every_config_key_has_a_comment_with_its_reason(config):
    source = inspect.getsource(config)
    fields = {name for name in vars(config)["__annotations__"] if name.islower()}
    assert fields <= {field.name for field in dataclasses.fields(config)}
    for name in fields:
        assert re.search(rf"^    {name}: .*  # .+", source, re.MULTILINE), name


@OF_ALL
def test_every_number_of_a_config_has_a_range(config):
    numbers = {field.name for field in dataclasses.fields(config) if field.type in ("int", "float")}
    assert set(config.RANGES if issubclass(config, MuZeroConfig) else dqn._RANGES) == numbers


@pytest.mark.parametrize(
    ("config", "values", "message"),
    [
        (dqn.DQNConfig, {"colour": "red"}, "unknown config key 'colour'; available: channels"),
        (dqn.DQNConfig, {"hidden": "many"}, "config key 'hidden': expected int, found 'many'"),
        (dqn.DQNConfig, {"symmetries": "perhaps"}, "config key 'symmetries': expected bool"),
        (dqn.DQNConfig, {"num_envs": "0"}, "expected config key 'num_envs' from 1"),
        (dqn.DQNConfig, {"learning_rate": "nan"}, "config key 'learning_rate': expected a finite number, found nan"),
        (dqn.DQNConfig, {"replay_capacity": "1000"}, "expected a replay_capacity of at least min_rows 20000"),
        (MMNConfig, {"search": "alpha"}, "'search' as one of gumbel, puct, found 'alpha'"),
        (MMNConfig, {"num_distances": "2"}, "unknown config key 'num_distances'"),
        (BeliefPlannerConfig, {"temperature": "0"}, "expected config key 'temperature' from 0.001"),
        (BeliefPlannerConfig, {"unroll": "9"}, "expected sequence_steps of at least unroll 9, found 8"),
    ],
)
def test_a_key_or_value_that_is_not_allowed_is_refused(config, values, message):
    with pytest.raises(InputError, match=message):
        override(config(), values)


def test_overrides_turn_text_into_the_fields_types():
    config = override(dqn.DQNConfig(), {"hidden": "64", "symmetries": "false", "learning_rate": "1e-3"})
    assert (config.hidden, config.symmetries, config.learning_rate) == (64, False, 1e-3)
