"""A maze in MuJoCo: model, body, physics, meshes, pictures."""

MAX_PIXELS = 1280  # a side of a picture; here, where it can be read without loading MuJoCo
