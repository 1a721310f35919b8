"""A maze in MuJoCo: model, body, physics, meshes, pictures."""

# Here, where it can be read without loading MuJoCo.
MAX_PIXELS = 1280  # a side of a picture
