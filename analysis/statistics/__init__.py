"""Tests, intervals and effect sizes for small samples, and the findings from them."""
