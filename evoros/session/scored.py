"""The scores of designs as a table that has the missions behind it."""

import pandas as pd


class ScoredDesigns(pd.DataFrame):
    """A row for each design; ``missions`` is the table of the missions that gave the scores.

    What is made of it by pandas is a plain table, without the missions.
    """

    _metadata = ["missions"]  # noqa: RUF012 - as pandas reads it
    missions: pd.DataFrame
