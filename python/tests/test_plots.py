"""Content of the figures."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import shapely
from conftest import constant

import sidestep
from sidestep import plots


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_figure_1_shows_the_level_sets_around_the_vehicles(people):
    trajectory = people[0][0]
    figure = plots.figure1(trajectory, 20)
    beginning, later, levels = figure.axes
    assert later.get_title() == "after 4 s"
    assert len(beginning.patches) == len(levels.patches) == 1
    # All panels show the same part of the plane, with every vehicle and outline.
    assert len({(*axes.get_xlim(), *axes.get_ylim()) for axes in figure.axes}) == 1
    low, high = np.transpose([levels.get_xlim(), levels.get_ylim()])
    shown = np.vstack([trajectory.states[[0, 20], :, :2].reshape(-1, 2), *(line.get_xydata() for line in levels.lines)])
    assert (low < shown).all() and (shown < high).all()
    (legend,) = figure.legends
    named = [text.get_text() for text in legend.get_texts()]
    assert named == ["human", "robot", "danger zone", "way to the goal", "$V_{HR} = 0$", "$V_{RH} = 0$"]
    outlines = {line.get_label(): line.get_xydata() for line in levels.lines if "V_" in line.get_label()}
    assert set(outlines) == {"$V_{HR} = 0$", "$V_{RH} = 0$"}
    car = sidestep.VehicleModel(2.0, 0.5)
    game = sidestep.PursuitGame(car, car, 3.0)
    human, robot = trajectory.states[20]
    # On the human's outline, a robot with its current heading has V_HR = 0.
    outline = outlines["$V_{HR} = 0$"]
    others = np.column_stack([outline, np.full(len(outline), robot[2])])
    seen = sidestep.relative_state(np.broadcast_to(human, others.shape), others)
    assert np.abs(sidestep.value(seen, game)).max() < 0.011
    figure.canvas.draw()


def test_figure_3_shows_the_regions(people):
    states = people[0][0].states[:21]
    found = [
        sidestep.ShfrsPredictor(constant([0.6, 0.3, 0.1]), sidestep.ShfrsSettings.paper(which)).predict(states)
        for which in ("left", "middle", "right")
    ]
    figure = plots.figure3(found, states[-1], ["left", "middle", "right"])
    for axes, prediction in zip(figure.axes, found, strict=True):
        drawn = [shapely.Polygon(patch.get_xy()).area for patch in axes.patches[:5]]
        # The largest first, so that the smaller ones stay visible.
        np.testing.assert_allclose(drawn[::-1], prediction.areas_m2, rtol=1e-9)
        assert axes.get_legend().get_texts()[0].get_text().startswith("$F_{1}$: ε = ")
    assert len({(*axes.get_xlim(), *axes.get_ylim()) for axes in figure.axes}) == 1
    distance = np.hypot(*(states[-1, 0, :2] - states[-1, 1, :2]))
    assert f"robot, {distance:.1f} m away" in [text.get_text() for text in figure.axes[0].texts]
    figure.canvas.draw()


@pytest.mark.parametrize("robot", [(0, 30, 0), (25, 3, 3), (-8, 0.5, 0), (6, -7, 1), (-9, 9, 0), (2, 0.5, 0)])
@pytest.mark.parametrize("psi", [0.2, 1.6, 3.0, -1.2])
def test_words_of_figure_3_stay_in_their_panel_and_in_the_figure(robot, psi):
    states = np.array([[[0, 0, psi], robot]])
    predictor = sidestep.ShfrsPredictor(constant([0.2, 0.6, 0.2]), sidestep.ShfrsSettings.paper())
    figure = plots.figure3([predictor.predict(states)] * 3, states[-1], ["left", "middle", "right"])
    figure.canvas.draw()
    whole, panels = figure.bbox, [axes.get_window_extent() for axes in figure.axes]
    for axes, panel in zip(figure.axes, panels, strict=True):
        words = [text for text in axes.texts if text.get_text()]
        assert words[0].get_text() == "human" and len(words) <= 2
        for text in [*words, axes.title]:
            box = text.get_window_extent()
            assert panel.x0 <= box.x0 and box.x1 <= panel.x1, text.get_text()
            assert whole.y0 <= box.y0 and box.y1 <= whole.y1, text.get_text()
        legend = axes.get_legend().get_window_extent()
        assert whole.y0 <= legend.y0 and legend.y1 < panel.y0


def test_an_arrowhead_is_where_the_vehicle_is_and_points_ahead():
    axes = plt.figure().subplots()
    plots.scene(axes, [[1.0, 2.0, np.pi / 2], [5.0, 3.0, np.pi]])
    drawn = [line for line in axes.lines if len(line.get_xdata())]
    for line, place, behind in zip(drawn, ([1.0, 2.0], [5.0, 3.0]), ([0, -1], [1, 0]), strict=True):
        np.testing.assert_array_equal(line.get_xydata(), [place])
        marker = line._marker
        outline = marker.get_transform().transform_path(marker.get_path()).vertices
        # The tip is the origin; all else is behind it.
        assert np.abs(outline[0]).max() < 1e-12 and (outline[1:4] @ behind > 0).all()


def test_refusals_name_the_argument(people):
    axes = plt.figure().subplots()
    with pytest.raises(ValueError, match=r"state: expected an array of shape \(2, 3\), found shape \(3,\)"):
        plots.scene(axes, [0, 0, 0])
    with pytest.raises(ValueError, match="step: expected 0 to 50, found 51"):
        plots.figure1(people[0][0], 51)
    with pytest.raises(ValueError, match="titles: expected one for each of 0 predictions, found 1"):
        plots.figure3([], np.zeros((2, 3)), ["a"])
