"""Fitness over the generations of runs: the best, the mean of the pool, quartiles over runs."""

import pandas as pd

LINES = ("recorded", "validated", "mean")


def select_bests(generations: pd.DataFrame) -> pd.DataFrame:
    """Select the best of each generation of one run, by generation; confirmed ones come first."""
    confirmed = generations["loss"].notna() if "loss" in generations else True
    ranked = generations.assign(confirmed=confirmed).sort_values(
        ["confirmed", "fitness"], ascending=False, kind="stable"
    )
    first = ranked.drop_duplicates("generation").drop(columns="confirmed")
    return first.set_index("generation").sort_index()


def trace_fitness(generations: pd.DataFrame) -> pd.DataFrame:
    """Compute the ``LINES`` of one run by generation: of its best, and the mean of its pool."""
    best = select_bests(generations)
    return pd.DataFrame(
        {
            "recorded": best["fitness"],
            "validated": best["validated_fitness"],
            "mean": generations.groupby("generation")["fitness"].mean(),
        }
    )


def list_individuals(generations: pd.DataFrame) -> pd.DataFrame:
    """List a row for each candidate of one run, with the ``LINES`` of its generation."""
    names = {"recorded": "best_recorded", "validated": "best_validated"}
    table = generations[["generation", "id", "operator", "fitness", "validated_fitness"]]
    return table.join(trace_fitness(generations).rename(columns=names), on="generation")


def compute_quartiles(generations: pd.DataFrame) -> pd.DataFrame:
    """Compute the quartiles of the ``LINES`` over runs: a row for each treatment and generation.

    ``replicates`` is the number of runs that have the generation, ``validated_replicates`` of
    those that validated its best. Quartiles are interpolated linearly.
    """
    runs = generations.groupby(["treatment", "run"])[list(generations.columns)]
    grouped = runs.apply(trace_fitness).groupby(["treatment", "generation"])
    table = grouped["recorded"].count().to_frame("replicates")
    table["validated_replicates"] = grouped["validated"].count()
    for line in LINES:
        for name, share in (("q1", 0.25), ("median", 0.5), ("q3", 0.75)):
            table[f"{line}_{name}"] = grouped[line].quantile(share)
    return table.loc[list(dict.fromkeys(generations["treatment"]))].reset_index()
