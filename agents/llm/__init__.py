"""Agents that plan in words: a language model, a person or a script decides on routes, which the robot drives."""

from .llm import LLM, ScriptBFS, ScriptHope, ScriptTold

__all__ = ["LLM", "ScriptBFS", "ScriptHope", "ScriptTold"]
