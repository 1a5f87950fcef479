"""The evolution: the experiment with its checks, and the ask, evaluate and tell loop."""
