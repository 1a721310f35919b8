"""A maze in MuJoCo: model, body, physics, meshes, pictures."""
