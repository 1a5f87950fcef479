"""A table of design scores that includes the scored missions."""

import pandas as pd


class ScoredDesigns(pd.DataFrame):
    """A row per design; ``missions`` is the table of the scored missions.

    Tables that pandas derives from this table are plain, without ``missions``.
    """

    _metadata = ["missions"]  # noqa: RUF012 - pandas requires this list
    missions: pd.DataFrame
