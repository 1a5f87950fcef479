"""Programs that the tests start: nodes as users write them, and what watches them."""
