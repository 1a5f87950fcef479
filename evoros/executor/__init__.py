"""Executors: where missions are computed. No result may depend on the choice."""
