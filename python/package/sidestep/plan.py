"""Plans of a robot: arrays with the length of their steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _sidestep

__all__ = ["Plan", "drive"]


class Plan(np.ndarray[Any, np.dtype[np.float64]]):
    """An array of poses (x, y, ψ), shape (…, T, 3), with the length of its steps, as returned by `drive`.

    `clear` refuses a plan whose steps are not those of the prediction. An array that NumPy derives from a plan keeps
    the length if it has the same number of steps. All other arrays are assumed to have the steps of the prediction.
    """

    _step_s: float | None = None

    @property
    def step_s(self) -> float | None:
        """Length of a step, s; `None` if unknown."""
        return self._step_s

    def __array_finalize__(self, other: Any, /) -> None:
        alike = isinstance(other, Plan) and self.shape[-2:] == other.shape[-2:]
        self._step_s = other.step_s if alike else None


def drive(start: ArrayLike, speed_mps: ArrayLike, turn_rates: ArrayLike, step_s: float) -> Plan:
    """The plan of a robot that holds a speed and a turn rate in each step, for `Shfrs.clear` and the like.

    Parameters
    ----------
    start : array of float64, shape (3,)
        The robot's pose (x, y, ψ) now, world frame, m, m, rad.
    speed_mps : float, or array of float64 of the shape of `turn_rates`
        Speed in each step, m/s; negative: backward.
    turn_rates : array of float64, shape (…, T), T ≥ 1
        Turn rate in each step, rad/s, left positive; at most half a turn per step. `clear` refuses exactly half a turn.
    step_s : float
        Length of a step > 0, s; must be that of the parameters of the prediction, or `clear` refuses the plan.

    Returns
    -------
    Plan, an array of float64, shape (…, T, 3)
        The poses (x, y, ψ) after steps 1 … T, without the current one, world frame, m, m, rad in (−π, π].
    """
    plan = _sidestep.drive(start, speed_mps, turn_rates, step_s).view(Plan)
    plan._step_s = float(step_s)
    return plan
