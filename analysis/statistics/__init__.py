"""Tests, intervals and effect sizes for small samples, and findings based on these."""
