"""Requirements on designs, and the statistical tests that decide them."""
