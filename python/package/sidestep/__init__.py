"""Reachability and stochastic human forward reachable sets, with NumPy arrays in and out.

Units are SI and radians. World frame: x to the right, y up, headings counter-clockwise from +x. A *relative state* is
the pursuer's pose in the evader's frame (x ahead, y to the left). Time is in steps. A turn to the left is positive.
Joint states are arrays of shape (n, 2, 3): the poses (x, y, psi) of the human and of the robot.

=========================================  ==========================================================
task                                       use
=========================================  ==========================================================
how safe is a state                        `value`, `state` (identical vehicles), `solve` (others)
the state of a game from two poses         `relative_state`
a game of your own, ẋ = f + Gu u + Gd d    `Grid`, `hj_solve`
which turns can be expected                `bounds`
where can a vehicle be                     `reach`, `ReachableSet`
predict sets and draw them                 `ShfrsPredictor`, `ShfrsSettings`
make a plan of speeds and turn rates       `drive`
predict in a robot's loop                  `OnlinePredictor`
is a plan clear of the human               `OnlinePredictor.clear`, `Shfrs.clear`, `largest_clear`
how probable is a collision, at most       `Calibration.collision`
choose ε with a guarantee                  `calibrate`; `Calibration.save` stores it
choose k or τ                              the command `sidestep shfrs` (in Rust: `tune`)
learn from recorded trials                 `features`, `from_sklearn`, `Predictor`, `ActionModel`
synthetic trials for tests                 `simulate`
read files of `sidestep export`            `sidestep.exports` (needs pandas or polars)
draw figures                               `sidestep.plots` (needs matplotlib)
=========================================  ==========================================================

The human is a point that moves at one constant speed with a bounded turn rate (a Dubins car), as participants drive it.
Reachable sets, predictions and clearances hold for such a human, and say nothing about a human who stops or walks at
another speed. After a step that such a human cannot have driven, to a millimetre and a milliradian, `clear` is −∞ and
`departure` has the measurement, unless `assume_vehicle` is set. SHFRS: stochastic human forward reachable sets, nested
regions F_1 ⊆ F_2 ⊆ … with probabilities.

An invalid value raises a `ValueError` that names the argument, the expected and the actual value; an argument of the
wrong type may raise a `TypeError` instead. A heading of more than a full turn is accepted with an `AngleWarning`,
because it may be in degrees.

All objects can be pickled, copied and compared, except functions of an `ActionModel` that Python itself cannot pickle,
such as a lambda. Predictors (`ShfrsPredictor`, `OnlinePredictor`) are pickled with their history, and equal only
themselves.
"""

from ._sidestep import (
    FEATURES,
    ActionModel,
    AngleWarning,
    Calibration,
    CollisionBound,
    Grid,
    OnlinePredictor,
    Predictor,
    PursuitGame,
    ReachableSet,
    SafetyLevels,
    SceneParameters,
    Shfrs,
    ShfrsPredictor,
    ShfrsSettings,
    Solution,
    Trajectory,
    ValueFunction,
    VehicleModel,
    __version__,
    bounds,
    calibrate,
    features,
    hj_solve,
    largest_clear,
    reach,
    relative_state,
    simulate,
    solve,
    state,
    value,
)
from .learn import SidestepClassifier, from_sklearn
from .plan import Plan, drive

__all__ = [
    "FEATURES",
    "ActionModel",
    "AngleWarning",
    "Calibration",
    "CollisionBound",
    "Grid",
    "OnlinePredictor",
    "Plan",
    "Predictor",
    "PursuitGame",
    "ReachableSet",
    "SafetyLevels",
    "SceneParameters",
    "Shfrs",
    "ShfrsPredictor",
    "ShfrsSettings",
    "SidestepClassifier",
    "Solution",
    "Trajectory",
    "ValueFunction",
    "VehicleModel",
    "__version__",
    "bounds",
    "calibrate",
    "drive",
    "features",
    "from_sklearn",
    "hj_solve",
    "largest_clear",
    "reach",
    "relative_state",
    "simulate",
    "solve",
    "state",
    "value",
]
