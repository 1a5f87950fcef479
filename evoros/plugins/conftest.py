"""Loads the test fixtures that all plug-ins share."""

pytest_plugins = ["needs", "shared_fixtures"]
