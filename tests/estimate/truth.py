"""A simulated mission beside its truth."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.estimate.stage import Estimated
from pipeline.mission import Mission
from pipeline.records import seconds
from pipeline.vehicle import Vehicle


class Trial(NamedTuple):
    """A simulated mission: what was logged, what is estimated from it, and what was true."""

    mission: Mission
    vehicle: Vehicle
    records: pd.DataFrame
    estimated: Estimated
    truth: pd.DataFrame

    def true(self, name: str) -> np.ndarray:
        """Return a true quantity at the instants of the records."""
        return np.interp(seconds(self.records["time"]), seconds(self.truth["time"]), self.truth[name])
