"""An allocation with trials for new designs only, as in the 2018 paper on Evo-ROS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evoros.allocation.protocol import Allocation, Standing


@dataclass(frozen=True)
class Once(Allocation):
    """Evaluates each design once; its fitness stays the same while it survives."""

    def most_trials(self, trials: int) -> int:
        return trials

    def next_round(self, standings: Sequence[Standing], trials: int) -> Mapping[int, int]:
        return {item.id: trials for item in standings if item.new and not item.scores}
