"""Models of robots and worlds for each engine."""
