"""Files: bundled folders, durable writing, safe reading, and the origin of this copy of evoros."""
