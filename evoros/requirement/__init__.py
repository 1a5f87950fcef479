"""Requirements on designs, and the tests that decide them."""
