"""Loads the test fixtures shared by all plug-ins."""

pytest_plugins = ["needs", "shared_fixtures"]
