"""Archives of studies as RO-Crates: written, and reproduced."""
