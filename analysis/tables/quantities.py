"""What axes and tables call the fitness of a study."""

from collections.abc import Iterable

from .records import Record

FITNESS = "fitness"


def label_fitness(records: Iterable[Record]) -> str:
    """Return the title and unit of the fitness; "fitness" alone if the records have several."""
    labels = {record.context.fitness.label for record in records}
    return labels.pop() if len(labels) == 1 else FITNESS


def label_by_treatment(records: Iterable[Record]) -> dict[str, str]:
    """Return the title and unit of the fitness of each treatment."""
    return {record.treatment: record.context.fitness.label for record in records}
