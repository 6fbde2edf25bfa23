//! Measures frames of a replay: the prediction and the picture of every layer, without the
//! browser's painting of the canvas.
//!
//! Uses the participants in `tests/data/trials.csv` and a predictor trained on them.

use super::{FEW, Figures};
use crate::recorded;
use sidestep::picture::Picture;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::shfrs::ShfrsSettings;
use sidestep::trial_view::layers::LAYERS;
use sidestep::trial_view::view::View;
use sidestep::trial_view::{Learned, Playback, Recorded};
use std::error::Error;
use std::hint::black_box;

/// Number of drives to play.
const DRIVES: usize = 3;
/// Number of evenly spaced moments in each drive.
const MOMENTS: u32 = 12;
/// Time between two frames, s.
const FRAME_S: f64 = 1.0 / 60.0;

pub(crate) fn measure(figures: &mut Figures<'_>) -> Result<(), Box<dyn Error>> {
    let parameters = SceneParameters::default();
    let safety = recorded::safety();
    let drives = recorded::drives();
    let (predictor, _) = recorded::split(&drives, 1, &safety);
    let settings = ShfrsSettings::paper(predictor.classes().len())?;
    let mut played = Vec::new();
    for (inputs, states) in drives.into_iter().take(DRIVES) {
        let scene = Scene::new(&parameters, states[0].human, states[0].robot);
        let inputs = inputs[..states.len() - 1].to_vec();
        let mut playback = Playback::new(Recorded { parameters, scene, inputs, states })?;
        playback.use_safety(safety.clone())?;
        let (predictor, settings) = (predictor.clone(), settings.clone());
        playback.use_learned(Some(Learned { predictor, settings }))?;
        played.push(playback);
    }
    let all = || View { shown: [true; LAYERS.len()], ..View::default() };
    let mut hatched = all();
    hatched.set("colours", "safe")?;
    let views = [("usual layers", View::default()), ("all layers", all()), ("hatched", hatched)];
    let mut picture = Picture::default();
    for (name, mut view) in views {
        // Draws two consecutive frames. Their headings differ if a vehicle turns.
        let mut frames = |playback: &mut Playback, moment: u32| {
            let begin_s = playback.duration_s() * f64::from(moment) / f64::from(MOMENTS);
            for frame in 0..2 {
                view.time_s = begin_s + f64::from(frame) * FRAME_S;
                playback.go(black_box(&view)).expect("the states are finite");
                picture.begin("canvas", playback.window());
                playback.paint(&view, &mut picture);
                black_box(&picture);
            }
        };
        let items = 2 * DRIVES * MOMENTS as usize;
        figures.add(&format!("frame, {name}"), items, || {
            for playback in &mut played {
                (0..MOMENTS).for_each(|moment| frames(playback, moment));
            }
        });
        let mut slowest = 0.0_f64;
        for playback in &mut played {
            for moment in 0..MOMENTS {
                slowest = slowest.max(figures.fastest(FEW, 2, || frames(playback, moment)));
            }
        }
        figures.seconds.push((format!("frame, {name}, slowest moment"), slowest));
    }
    Ok(())
}
