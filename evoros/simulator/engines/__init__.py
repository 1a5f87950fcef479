"""How each simulator represents a robot and a world."""
