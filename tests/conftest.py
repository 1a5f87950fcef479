"""Loads the fixtures that all tests share."""

pytest_plugins = ["needs", "shared_fixtures"]
