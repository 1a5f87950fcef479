"""Generated worlds: random fields of obstacles with a way through them."""
