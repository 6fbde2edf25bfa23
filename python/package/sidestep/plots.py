"""The paper's figures with matplotlib: scenes, level sets and predicted regions.

Each function draws on axes, which it gives equal scales in x and y, or makes a whole figure. World frame, m.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ._sidestep import SafetyLevels, SceneParameters, Shfrs, Trajectory, ValueFunction

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.markers import MarkerStyle

__all__ = ["HUMAN", "REGIONS", "ROBOT", "SAFE_REGIONS", "figure1", "figure3", "level_set", "regions", "scene"]

HUMAN = "#2d6fe0"
"""The human's colour."""
ROBOT = "#e0453a"
"""The robot's colour."""
REGIONS = ("#e2504a", "#e6bd3c", "#46a063", "#4477d3", "#9367cf")
"""Regions from the innermost outwards, as in the paper."""
SAFE_REGIONS = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
"""The same for colour-blind readers: the colours differ in lightness."""

# On coloured regions both vehicles are dark.
_DARK, _GREY = "#1b1f27", "#737985"
# For legends: a centred arrowhead.
_ARROWHEAD = ((1.0, 0.0), (-1.0, 0.72), (-0.56, 0.0), (-1.0, -0.72), (1.0, 0.0))


def scene(
    axes: Axes,
    state: ArrayLike,
    *,
    parameters: SceneParameters | None = None,
    goal: ArrayLike | None = None,
    trail: ArrayLike | None = None,
    colours: tuple[str, str] = (HUMAN, ROBOT),
) -> None:
    """Both vehicles as arrowheads whose tips mark their positions, and the danger zone around the robot.

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
    colours : (str, str)
        Colours of the human and of the robot.
    """
    from matplotlib.patches import Circle
    from matplotlib.patheffects import withStroke

    poses = _poses("state", state, (2, 3))
    parameters = parameters or SceneParameters()
    zone = Circle(
        tuple(poses[1, :2]), parameters.danger_radius_m, color=colours[1], alpha=0.13, lw=0, label="danger zone"
    )
    axes.add_patch(zone)
    if goal is not None:
        way = np.vstack([poses[1, :2], np.asarray(goal, dtype=float)])
        axes.plot(*way.T, color=colours[1], lw=1, ls=(0, (2, 3)), label="way to the goal")
        axes.plot(*way[1], marker="s", ms=6, color=colours[1], ls="none")
    if trail is not None:
        driven = _poses("trail", trail, (None, 2, 3))
        for vehicle, colour in enumerate(colours):
            axes.plot(driven[:, vehicle, 0], driven[:, vehicle, 1], color=colour, lw=1.6, alpha=0.55)
    for (x, y, psi), colour, name in zip(poses, colours, ("human", "robot"), strict=True):
        axes.plot(
            x, y, marker=_arrowhead(psi), ms=36, mfc=colour, mec="none", ls="none", zorder=4,
            path_effects=[withStroke(linewidth=1.2, foreground="white")],
        )
        # In the legend it points to the right, whatever the heading.
        axes.plot([], [], marker=_ARROWHEAD, ms=14, mfc=colour, mec="none", ls="none", label=name)
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
        Colour and label of the outline.
    """
    x, y, psi = _poses("evader", evader, (3,))
    other = _poses("pursuer", pursuer, (3,))
    turn = np.array([[np.cos(psi), np.sin(psi)], [-np.sin(psi), np.cos(psi)]])
    for curve in function.level_curves(float(other[2] - psi), level):
        outline = np.vstack([curve, curve[:1]]) @ turn + [x, y]
        axes.plot(outline[:, 0], outline[:, 1], color=colour, lw=1.8, label=label)
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
        From the innermost outwards; `SAFE_REGIONS` for colour-blind readers. They repeat for more sets.
    legend : bool
        Whether to add a legend with ε and the area of each set.
    """
    from matplotlib.patches import Polygon
    from matplotlib.transforms import ScaledTranslation

    sets = list(zip(prediction.tubes, prediction.epsilon, prediction.areas_m2, strict=True))
    drawn = []
    for j, (tube, epsilon, area) in reversed(list(enumerate(sets))):
        label = f"$F_{{{j + 1}}}$: ε = {epsilon:.2f} rad/s, {area:.2f} m²"
        drawn.append(axes.add_patch(Polygon(tube, color=colours[j % len(colours)], lw=0, label=label)))
    axes.autoscale_view()
    if legend and sets:
        # Below the axis label, so that it hides nothing.
        axes.legend(
            handles=drawn[::-1], fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, 0),
            bbox_transform=axes.transAxes + ScaledTranslation(0, -34 / 72, axes.figure.dpi_scale_trans),
        )
    _metres(axes)


def figure1(
    trajectory: Trajectory,
    step: int,
    *,
    parameters: SceneParameters | None = None,
    safety: SafetyLevels | None = None,
) -> Figure:
    """The paper's Figure 1: a scene at its beginning and at a later step, and the zero level sets at that step.

    All panels show the same part of the plane, that of the vehicles, danger zones and level sets.

    Parameters
    ----------
    trajectory : Trajectory
    step : int
        0 to the number of steps.
    parameters : SceneParameters, optional
        The paper's by default.
    safety : SafetyLevels, optional
        Those of `parameters` by default, which are slow to compute if the vehicles differ.
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

    figure, panels = plt.subplots(1, 3, figsize=(11, 4), layout="constrained")
    scene(panels[0], states[0], parameters=parameters, goal=goal)
    panels[0].set_title("at the beginning")
    scene(panels[1], states[step], parameters=parameters, goal=goal, trail=states[: step + 1])
    panels[1].set_title(f"after {seconds:g} s")
    scene(panels[2], states[step], parameters=parameters, trail=states[: step + 1])
    level_set(panels[2], safety.human, human, robot, label="$V_{HR} = 0$")
    level_set(panels[2], safety.robot, robot, human, colour=ROBOT, label="$V_{RH} = 0$")
    panels[2].set_title(f"zero level sets after {seconds:g} s")

    outlines = [line.get_xydata() for line in panels[2].lines]
    zones = [states[i, 1, :2] + side * parameters.danger_radius_m for i in (0, step) for side in (-1, 1)]
    poses = states[[0, step]].reshape(-1, 3)
    tails = poses[:, :2] - 1.2 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    low, high = _alike(panels, np.vstack([*outlines, poses[:, :2], tails, *zones]))
    # The height of three panels of this shape side by side, with titles and the legend.
    wide, high_m = high - low
    figure.set_size_inches(11, min(11 / 3.15 * high_m / wide, 7) + 1.25)
    named: dict[str, Artist] = {}
    for axes in panels:
        named |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    order = ["human", "robot", "danger zone", "way to the goal"]
    order += [label for label in named if label not in order]
    figure.legend(
        [named[label] for label in order], order, loc="outside lower center", ncols=len(order), frameon=False
    )
    return figure


def figure3(
    predictions: Sequence[Shfrs],
    states: ArrayLike,
    titles: Sequence[str],
    *,
    parameters: SceneParameters | None = None,
    colours: Sequence[str] = REGIONS,
) -> Figure:
    """The paper's Figure 3: predictions for the same instant, side by side.

    All panels show the same part of the plane, that of the sets; where the robot is outside, an arrow points to it.

    Parameters
    ----------
    predictions : list of Shfrs
    states : array of float64, shape (2, 3)
        The poses (x, y, ψ) of the human and of the robot at that instant.
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
    human, robot = _poses("states", states, (2, 3))
    size = (max(3.2 * len(predictions), 5.2), 5.4)
    figure, panels = plt.subplots(1, len(predictions), figsize=size, layout="constrained", squeeze=False)
    for axes, prediction, title in zip(panels[0], predictions, titles, strict=True):
        regions(axes, prediction, colours=colours)
        scene(axes, states, parameters=parameters, colours=(_DARK, _GREY))
        axes.set_title(title)
    points = np.vstack([*(tube for prediction in predictions for tube in prediction.tubes), human[:2]])
    extent = float(np.ptp(points, axis=0).max())
    away = robot[:2] - human[:2]
    distance = float(np.hypot(*away))
    outside = ((robot[:2] < points.min(axis=0)) | (robot[:2] > points.max(axis=0))).any() and distance > 0
    if outside:
        # Make room for an arrow beyond the sets.
        ahead = away / distance
        # Keep it off the human's arrowhead.
        reach = max(float(((points - human[:2]) @ ahead).max()), 0.15 * extent)
        beyond = human[:2] + ahead * (reach + 0.2 * extent)
        points = np.vstack([points, beyond])
    heading, right = np.array([[np.cos(human[2]), np.sin(human[2])], [np.sin(human[2]), -np.cos(human[2])]])
    side = "left" if right[0] > 0.3 else "right" if right[0] < -0.3 else "center"
    # Make room for the word, which is at most 42 points wide; a panel is at least 150 points wide.
    begins = {"left": 0, "right": -42, "center": -21}[side]
    word = 11 * right - 14 * heading + np.array([[begins, -6], [begins + 42, 6]])
    points = np.vstack([points, human[:2] - 0.15 * extent * heading, human[:2] + word * extent / 150])
    low, high = _alike(panels[0], points)
    # The height of a panel of this shape, with titles and the legend.
    wide, high_m = high - low
    legend = 0.18 * max(len(prediction) for prediction in predictions)
    figure.set_size_inches(size[0], min(2.9 * high_m / wide, 7) + 1.6 + legend)
    for axes in panels[0]:
        axes.annotate(
            "human", human[:2], 11 * right - 14 * heading, textcoords="offset points", color=_DARK, fontsize="small",
            ha=side, va="center",
        )
        if outside:
            axes.annotate(
                "", beyond, beyond - 0.14 * extent * ahead,
                arrowprops={"arrowstyle": "-|>", "color": _GREY, "lw": 1.4, "shrinkA": 0, "shrinkB": 0},
            )
            # In the empty space below the title.
            axes.set_title(axes.get_title(), pad=20)
            axes.annotate(
                f"robot, {distance:.1f} m away", (0.5, 1), (0, 4), xycoords="axes fraction",
                textcoords="offset points", color=_GREY, fontsize="small", ha="center", va="bottom",
            )
    return figure


def _arrowhead(psi: float) -> MarkerStyle:
    """A marker with its tip at the position that points along this heading, rad."""
    from matplotlib.markers import MarkerStyle
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    outline = Path([(0, 0), (-1, 0.36), (-0.78, 0), (-1, -0.36), (0, 0)])
    return MarkerStyle(outline, transform=Affine2D().rotate(psi), joinstyle="round")


def _alike(panels: Sequence[Axes], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shows the same part of the plane in all panels: around these points, with a margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.06 * float((high - low).max())
    low, high = low - margin, high + margin
    for axes in panels:
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.grid(color="0.93", lw=0.8)
        axes.set_axisbelow(True)
        axes.tick_params(color="0.75", labelcolor="0.3", labelsize="small")
        axes.spines[:].set_color("0.75")
        axes.label_outer()
    return low, high


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
