"""The navigation task: options, episodes and their rules, observations, the dm_control environment."""

# The version of what an episode is. Gymnasium's ids end with it, and docs/release.md says when it grows. It is defined
# here because `import mazebench` registers the ids and should load nothing else.
TASK_VERSION = 1
TRACKS_VERSION = 2  # of the tracks
