"""Simulators: one file an engine; nothing else imports the engine's library."""
