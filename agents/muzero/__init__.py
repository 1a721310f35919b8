"""The parts of MuZero: a network with a latent model, its losses and learner, and search, which MMN alone uses."""
