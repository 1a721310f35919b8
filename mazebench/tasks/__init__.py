"""The navigation task: episodes and their rules, the context, the dm_control environment."""
