"""Run folders on disk: written, read, verified."""
