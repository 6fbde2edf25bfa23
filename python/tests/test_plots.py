"""What figures show."""

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
    outlines = {line.get_label(): line.get_xydata() for line in levels.lines if "V_" in line.get_label()}
    assert set(outlines) == {"$V_{HR} = 0$", "$V_{RH} = 0$"}
    car = sidestep.VehicleModel(2.0, 0.5)
    game = sidestep.PursuitGame(car, car, 3.0)
    human, robot = trajectory.states[20]
    # On the human's outline, a robot with its present heading has V_HR = 0.
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
        # The largest first, so that the smaller ones remain to be seen.
        np.testing.assert_allclose(drawn[::-1], prediction.areas_m2, rtol=1e-9)
        assert axes.get_legend().get_texts()[0].get_text().startswith("$F_{1}$: ε = ")
    figure.canvas.draw()


def test_refusals_name_the_argument(people):
    axes = plt.figure().subplots()
    with pytest.raises(ValueError, match=r"state: expected an array of shape \(2, 3\), found shape \(3,\)"):
        plots.scene(axes, [0, 0, 0])
    with pytest.raises(ValueError, match="step: expected 0 to 50, found 51"):
        plots.figure1(people[0][0], 51)
    with pytest.raises(ValueError, match="titles: expected one for each of 0 predictions, found 1"):
        plots.figure3([], np.zeros((2, 3)), ["a"])
