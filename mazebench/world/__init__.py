"""A maze in MuJoCo: model, body, physics, pictures."""
