"""Onsets: the time, place or event at which a part fails."""
