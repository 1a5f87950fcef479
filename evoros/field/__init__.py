"""Generated worlds: random fields of obstacles with a free path."""
