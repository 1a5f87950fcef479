"""Run one mission: a design in a world, with random faults and noise."""
