"""The navigation task: episodes and their rules, the context, the dm_control environment."""

# The version of what an episode is; docs/release.md says when it grows, and Gymnasium's ids end with it. Here, where it
# costs no import, because `import mazebench` registers them.
TASK_VERSION = 1
