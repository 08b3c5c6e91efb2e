"""What the programs `runner` and `results` leave behind, in Python.

    import dreamsearch

    dreamsearch.read("v_final", db="results/dreamsearch.db")    # a view as a pandas table
    agent = dreamsearch.Agent("walker.safetensors")             # what `runner export` wrote
    dreamsearch.play(agent, environment, episodes=10)           # in dm_control or Gymnasium

An agent needs NumPy alone; pandas is imported when a table is read.
"""

from .agent import Agent
from .playing import play
from .tables import query, read, views

__all__ = ["Agent", "play", "query", "read", "views"]
