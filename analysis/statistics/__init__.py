"""Tests, intervals and effect sizes of small samples, and their findings."""
