"""The paper's figures with matplotlib: scenes, level sets and predicted regions.

Each function adds to axes, which it makes equal in x and y. World frame, m.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ._sidestep import SafetyLevels, SceneParameters, Shfrs, Trajectory, ValueFunction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["HUMAN", "REGIONS", "ROBOT", "SAFE_REGIONS", "figure1", "figure3", "level_set", "regions", "scene"]

HUMAN = "#2d6fe0"
"""The human's colour."""
ROBOT = "#e0453a"
"""The robot's colour."""
REGIONS = ("#e2504a", "#e6bd3c", "#46a063", "#4477d3", "#9367cf")
"""Regions from the innermost outwards, as in the paper."""
SAFE_REGIONS = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
"""The same for all eyes: they differ in lightness alone too."""


def scene(
    axes: Axes,
    state: ArrayLike,
    *,
    parameters: SceneParameters | None = None,
    goal: ArrayLike | None = None,
    trail: ArrayLike | None = None,
) -> None:
    """Both vehicles as arrows whose tails mark their positions, and the danger zone around the robot.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    state : array of float64, shape (2, 3)
        The poses (x, y, ψ) of the human and of the robot.
    parameters : SceneParameters, optional
        The paper's by default.
    goal : array of float64, shape (2,), optional
        The robot's goal.
    trail : array of float64, shape (n, 2, 3), optional
        Joint states up to now.
    """
    from matplotlib.patches import Circle

    poses = _poses("state", state, (2, 3))
    parameters = parameters or SceneParameters()
    axes.add_patch(Circle(tuple(poses[1, :2]), parameters.danger_radius_m, color=ROBOT, alpha=0.12, lw=0))
    if trail is not None:
        driven = _poses("trail", trail, (None, 2, 3))
        for vehicle, colour in ((0, HUMAN), (1, ROBOT)):
            axes.plot(driven[:, vehicle, 0], driven[:, vehicle, 1], color=colour, lw=1, alpha=0.6)
    for (x, y, psi), colour, name in zip(poses, (HUMAN, ROBOT), ("human", "robot"), strict=True):
        axes.quiver(
            x, y, np.cos(psi), np.sin(psi), color=colour, angles="xy", scale_units="xy", scale=0.7, width=0.012,
            zorder=3, label=name,
        )
    if goal is not None:
        axes.plot(*np.asarray(goal, dtype=float), marker="s", color=ROBOT, ls="none", label="goal")
    _metres(axes)


def level_set(
    axes: Axes,
    function: ValueFunction,
    evader: ArrayLike,
    pursuer: ArrayLike,
    *,
    level: float = 0.0,
    colour: str = HUMAN,
    label: str | None = None,
) -> None:
    """The set {V ≤ level} around the evader, for the pursuer's heading: where it must not be.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    function : ValueFunction
    evader, pursuer : array of float64, shape (3,)
        Poses (x, y, ψ), world frame.
    level : float
        m.
    colour, label : str
        Of the outline.
    """
    x, y, psi = _poses("evader", evader, (3,))
    other = _poses("pursuer", pursuer, (3,))
    turn = np.array([[np.cos(psi), np.sin(psi)], [-np.sin(psi), np.cos(psi)]])
    for curve in function.level_curves(float(other[2] - psi), level):
        outline = np.vstack([curve, curve[:1]]) @ turn + [x, y]
        axes.plot(outline[:, 0], outline[:, 1], color=colour, lw=1.5, label=label)
        label = None
    _metres(axes)


def regions(
    axes: Axes, prediction: Shfrs, *, colours: Sequence[str] = REGIONS, legend: bool = True
) -> None:
    """The nested sets of a prediction, the smallest on top.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    prediction : Shfrs
    colours : list of str
        From the innermost outwards; `SAFE_REGIONS` for all eyes. They repeat for more sets.
    legend : bool
        Whether to say ε and the area of each set.
    """
    from matplotlib.patches import Polygon

    sets = list(zip(prediction.tubes, prediction.epsilon, prediction.areas_m2, strict=True))
    for j, (tube, epsilon, area) in reversed(list(enumerate(sets))):
        label = f"$F_{{{j + 1}}}$: ε = {epsilon:g} rad/s, {area:.2f} m²"
        axes.add_patch(Polygon(tube, color=colours[j % len(colours)], lw=0, label=label))
    axes.autoscale_view()
    if legend and sets:
        handles, labels = axes.get_legend_handles_labels()
        # Below, so that it hides nothing.
        axes.legend(handles[::-1], labels[::-1], fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.13))
    _metres(axes)


def figure1(
    trajectory: Trajectory,
    step: int,
    *,
    parameters: SceneParameters | None = None,
    safety: SafetyLevels | None = None,
) -> Figure:
    """The paper's Figure 1: a scene at its beginning and at a later step, and the zero level sets at that step.

    Parameters
    ----------
    trajectory : Trajectory
    step : int
        0 to the number of steps.
    parameters : SceneParameters, optional
        The paper's by default.
    safety : SafetyLevels, optional
        Those of `parameters` by default, which takes long if the vehicles differ.
    """
    import matplotlib.pyplot as plt

    states = trajectory.states
    if not 0 <= step < len(states):
        raise ValueError(f"step: expected 0 to {len(states) - 1}, found {step}")
    parameters = parameters or SceneParameters()
    safety = safety or SafetyLevels(parameters)
    ahead = parameters.robot.speed_mps * parameters.step_s * trajectory.steps
    x, y, psi = states[0, 1]
    goal = [x + ahead * np.cos(psi), y + ahead * np.sin(psi)]
    human, robot = states[step]
    seconds = step * parameters.step_s

    figure, panels = plt.subplots(1, 3, figsize=(12, 4.2), layout="constrained")
    scene(panels[0], states[0], parameters=parameters, goal=goal)
    panels[0].set_title("at the beginning")
    scene(panels[1], states[step], parameters=parameters, goal=goal, trail=states[: step + 1])
    panels[1].set_title(f"after {seconds:g} s")
    scene(panels[2], states[step], parameters=parameters, goal=goal)
    level_set(panels[2], safety.human, human, robot, label="$V_{HR} = 0$")
    level_set(panels[2], safety.robot, robot, human, colour=ROBOT, label="$V_{RH} = 0$")
    panels[2].set_title(f"zero level sets after {seconds:g} s")
    panels[2].legend(fontsize="small")
    return figure


def figure3(
    predictions: Sequence[Shfrs],
    states: ArrayLike,
    titles: Sequence[str],
    *,
    parameters: SceneParameters | None = None,
    colours: Sequence[str] = REGIONS,
) -> Figure:
    """The paper's Figure 3: predictions for the same moment, side by side.

    Parameters
    ----------
    predictions : list of Shfrs
    states : array of float64, shape (2, 3)
        The poses (x, y, ψ) of the human and of the robot at that moment.
    titles : list of str
        One for each prediction.
    parameters : SceneParameters, optional
        The paper's by default.
    colours : list of str
        As for `regions`.
    """
    import matplotlib.pyplot as plt

    if len(titles) != len(predictions) or not predictions:
        raise ValueError(f"titles: expected one for each of {len(predictions)} predictions, found {len(titles)}")
    size = (4 * len(predictions), 5.5)
    figure, panels = plt.subplots(1, len(predictions), figsize=size, layout="constrained", squeeze=False)
    for axes, prediction, title in zip(panels[0], predictions, titles, strict=True):
        regions(axes, prediction, colours=colours)
        scene(axes, states, parameters=parameters)
        axes.set_title(title)
    return figure


def _poses(name: str, poses: ArrayLike, shape: tuple[int | None, ...]) -> np.ndarray:
    """Poses as an array, if it has this shape."""
    array = np.asarray(poses, dtype=float)
    fits = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
    if not fits:
        expected = ", ".join("n" if n is None else str(n) for n in shape)
        raise ValueError(f"{name}: expected an array of shape ({expected}), found shape {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers, found NaN or an infinity")
    return array


def _metres(axes: Axes) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
