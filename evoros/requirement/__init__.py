"""Requirements on designs, and statistical tests of them."""
