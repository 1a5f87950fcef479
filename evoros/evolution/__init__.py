"""The evolution: an experiment, checked, and its loop of ask, evaluate and tell."""
