"""Files: the bundled ones, durable writing, and where this copy of evoros comes from."""
