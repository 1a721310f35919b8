"""The parts of MuZero: a network with a latent model, its targets and losses, and search, which MMN alone uses."""
