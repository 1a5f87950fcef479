"""Confirmation, validation and final choice of champions."""
