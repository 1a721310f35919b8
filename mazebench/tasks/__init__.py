"""The navigation task: options, episodes and their rules, and what an agent observes."""
