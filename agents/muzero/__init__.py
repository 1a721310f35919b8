"""The tree search of MuZero and Gumbel MuZero, which knows no network; MMN uses it."""
