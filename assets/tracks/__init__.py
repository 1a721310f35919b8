"""The benchmark `tracks`: mazes of several kinds, in the splits train, dev and eval, and their frozen episodes."""
