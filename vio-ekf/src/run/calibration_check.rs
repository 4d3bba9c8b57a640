//! The calibration of a recording: what [`CalibrationWatch`] finds beside a filter, with the whole recording at hand.

#![allow(clippy::option_option, reason = "nothing yet, nothing found, or a doubt")]

use crate::filter::vio::Vio;
use crate::run::calibration_doubt::{CalibrationDoubt, CalibrationPart};
use crate::run::calibration_trial::CalibrationTrial;
use crate::run::calibration_watch::{CalibrationWatch, hypotheses};
use crate::run::frames::{Picture, RecordedFrame};
use crate::samples::Imu;

/// What the first thirty seconds of motion of a recording say against the calibration of a filter that has not started: as a
/// [`Runner`](crate::run::Runner) does it beside the filter, by itself. `frames` is asked for the frames anew for each try.
///
/// Of two cameras, if anything is doubted, the first is checked alone, and only if that is right what is doubted of both is said: one
/// camera keeps its way where two lose theirs, and what is wrong with the second shows when the first has been put right.
pub fn check_calibration<P: Picture, F: IntoIterator<Item = RecordedFrame<P>>>(
    vio: &Vio,
    samples: &[Imu],
    frames: impl Fn() -> F,
) -> Option<CalibrationDoubt> {
    let mut of_both = searches(vio, samples, &frames)?;
    let first = of_both.next()?;
    let is_exchanged = |doubt: &CalibrationDoubt| doubt.parts.contains(&CalibrationPart::CameraOrder);
    if first.as_ref().is_some_and(|found| found.as_ref().is_none_or(is_exchanged)) {
        return first?;
    }
    let single = || frames().into_iter().map(|frame| RecordedFrame { second: None, ..frame });
    let of_one = vio.first_camera_alone().and_then(|alone| searches(&alone, samples, &single)?.flatten().next()?);
    of_one.or_else(|| std::iter::once(first).chain(of_both).flatten().next()?)
}

/// What each hypothesis finds; `None` where its filter diverges, or sees too little.
fn searches<P: Picture, F: IntoIterator<Item = RecordedFrame<P>>>(
    vio: &Vio,
    samples: &[Imu],
    frames: &impl Fn() -> F,
) -> Option<impl Iterator<Item = Option<Option<CalibrationDoubt>>>> {
    let watch = CalibrationWatch::beside(vio)?;
    Some(hypotheses(vio).into_iter().map(move |rough| check(watch.with_hypothesis(rough), samples, frames)))
}

fn check<P: Picture, F: IntoIterator<Item = RecordedFrame<P>>>(
    mut watch: CalibrationWatch,
    samples: &[Imu],
    frames: &impl Fn() -> F,
) -> Option<Option<CalibrationDoubt>> {
    let mut count = 0_usize;
    if let Some(found) = follow(&mut watch, samples, frames().into_iter().inspect(|_| count += 1)) {
        return (!watch.has_diverged()).then_some(found);
    }
    // A trial would rather be held over images in which nothing was found, but the recording ended before.
    if watch.restart_trial() {
        let latest = frames().into_iter().skip(count.saturating_sub(CalibrationTrial::MOST));
        return follow(&mut watch, samples, latest).or_else(|| Some(watch.finish()));
    }
    watch.has_seen_enough().then(|| watch.finish())
}

/// Gives it a recording until it has seen enough.
fn follow<P: Picture>(
    watch: &mut CalibrationWatch,
    samples: &[Imu],
    frames: impl IntoIterator<Item = RecordedFrame<P>>,
) -> Option<Option<CalibrationDoubt>> {
    let mut samples = samples.iter();
    for RecordedFrame { stamp, picture, second } in frames {
        let Ok(picture) = picture else { continue };
        let time = stamp.plus_secs(watch.time_offset_s());
        while watch.latest().is_none_or(|latest| latest < time) {
            let Some(sample) = samples.next() else { break };
            watch.imu(sample);
        }
        let second = second.and_then(Result::ok);
        let found = watch.images(stamp, &picture.view(), second.as_ref().map(Picture::view).as_ref());
        if found.is_some() {
            return found;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::camera::Camera;
    use crate::filter::settings::Settings;
    use crate::run::calibration_doubt::tests::{doubt, found};
    use crate::samples::ImuNoise;
    use crate::sim::{Frame, RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};

    /// What is left of a recording when a wrong focal length is tried starts no filter.
    #[test]
    fn a_trial_that_a_recording_is_too_short_for_goes_over_all_of_it() {
        let (sound, seed) = (camera_ahead(), 6);
        let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
        let cameras = vec![SimulatedCamera { camera: sound, ..SimulatedCamera::default() }];
        let scenario = Scenario { seed, cameras, room, ..Scenario::default() };
        let simulation = Simulation::new(painting_flight(seed, 10.0).unwrap(), scenario).unwrap();
        let all = 0..simulation.frame_count(0);
        let seen: Vec<Frame> = all.filter_map(|index| simulation.frame(0, index).unwrap()).collect();
        let recorded = |seen: &[Frame]| -> Vec<RecordedFrame<Frame>> {
            seen.iter().map(|frame| RecordedFrame::single(frame.stamp, frame.clone())).collect()
        };
        let wrong = Camera { fx: 1.02 * sound.fx, fy: 1.02 * sound.fy, ..sound };
        let given = Vio::new(sound, ImuNoise::default(), Settings::default()).unwrap();
        let mut watch = CalibrationWatch::beside(&given).unwrap();
        watch.try_out(vec![doubt(&sound, &found(wrong), CalibrationPart::FocalLength)]);
        let passes = Cell::new(0);
        let frames = || {
            passes.set(passes.get() + 1);
            recorded(if passes.get() == 1 { &seen[seen.len() - 10..] } else { &seen })
        };
        assert_eq!(check(watch, &simulation.imu(0).unwrap().samples, &frames), Some(None));
        assert_eq!(passes.get(), 2);
    }
}
