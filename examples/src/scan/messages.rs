//! What happened with a frame, in words.

use tsdf_hash::slam::{CameraDoubt, Event, FrameOutcome, LeftOut};
use tsdf_hash::tracking::{TrackingOutcome, TrackingStatus};

use super::error::ScanError;

/// The line that an event is worth. `name` names a frame; a frame that is left out is told at the end.
pub(super) fn line(event: &Event, outcome: &FrameOutcome, name: impl Fn(usize) -> String) -> Option<String> {
    let here = || name(outcome.frame);
    Some(match event {
        Event::Lost => {
            let tracking = outcome.tracking.as_ref()?;
            format!("warning: {}: the camera is lost: {}", here(), reason(tracking))
        }
        Event::Found => format!("{}: the camera is found again", here()),
        Event::Degenerate { directions } => format!(
            "warning: {}: {directions} of 6 directions of the pose are not fixed: before a wall or along a corridor only odometry knows them \
             (--poses odometry)",
            here()
        ),
        Event::LowFusedShare { frame, share } => format!(
            "warning: {}: only {:.0} % of the valid pixels were fused: neighbouring depths differ by more than the \
             noise of the camera. Check --depth-scale, or tell the noise by --noise",
            name(*frame),
            100.0 * share
        ),
        Event::LowAgreement { agreement } => format!(
            "warning: {}: only {:.0} % of the depth agrees with the map at the given poses: check camera \
             (--intrinsics), --depth-scale and poses",
            here(),
            100.0 * agreement
        ),
        Event::CameraDoubted(doubt) => format!("warning: {}: {}", here(), camera(doubt)),
        Event::AdjustmentRefused { frame } => format!(
            "{}: the keyframes agree less after a bundle adjustment: the poses stay as the pose graph has them",
            name(*frame)
        ),
        Event::LoopClosed { frame, keyframe, drift, distance } if drift.is_significant() => {
            let degrees = drift.angle().to_degrees();
            format!("{}: back at keyframe {keyframe}: drift {:.1} mm, {degrees:.2} deg", name(*frame), 1e3 * distance)
        }
        _ => return None,
    })
}

/// What a doubtful camera should be.
pub(super) fn camera(doubt: &CameraDoubt) -> String {
    let CameraDoubt { fits_better: k, agreement, .. } = doubt;
    let [given, better] = agreement.map(|share| 100.0 * share);
    format!(
        "the frames do not fit each other with this camera: {given:.0} % of the depth agrees, with \
         --intrinsics {:.1},{:.1},{:.1},{:.1} {better:.0} %",
        k.fx, k.fy, k.cx, k.cy
    )
}

/// Why a frame was left out.
pub(super) fn fault(why: LeftOut, tracking: Option<&TrackingOutcome>) -> ScanError {
    match why {
        LeftOut::Lost { places } => {
            let search = match places {
                0 => "no keyframe of the map agrees with what it sees",
                1 => "a place agrees; more frames, from other poses, must confirm it",
                _ => "several places agree; more frames must tell them apart",
            };
            ScanError::Lost(tracking.map_or(search.into(), |outcome| format!("{}; {search}", reason(outcome))))
        }
        LeftOut::Degenerate { directions } => ScanError::Degenerate(directions),
        LeftOut::Refused(error) => error.into(),
        // A frame without a pose is not read.
        _ => ScanError::NoPose("no pose was recorded for it"),
    }
}

fn reason(outcome: &TrackingOutcome) -> String {
    let (overlap, agreement) = (100.0 * outcome.overlap, 100.0 * outcome.agreement);
    match outcome.status {
        TrackingStatus::NoOverlap => {
            let coverage = 100.0 * outcome.coverage;
            format!(
                "{overlap:.0} % of the map in view were measured, {coverage:.0} % of the frame are in the map: too little"
            )
        }
        TrackingStatus::Disagreement => format!("only {agreement:.0} % of the pixels agree with the map"),
        TrackingStatus::Rejected => "the motion is not plausible".into(),
        TrackingStatus::Degenerate => "its shape does not fix the pose".into(),
        TrackingStatus::Tracked => "it is not".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_nothing_fixes_are_counted() {
        let outcome = FrameOutcome {
            frame: 7,
            world_from_camera: None,
            tracking: None,
            events: Vec::new(),
            tracking_seconds: None,
        };
        let said = line(&Event::Degenerate { directions: 3 }, &outcome, |frame| format!("frame {frame}")).unwrap();
        assert!(said.starts_with("warning: frame 7: 3 of 6 directions of the pose are not fixed"), "{said}");
    }
}
