"""The evolution: an experiment with its checks, and the loop of ask, evaluate and tell."""
