//! The times of frames: given, or a thirtieth of a second apart.

use crate::error::Error;

/// Seconds that pass with a frame of unknown time: the usual camera takes 30 a second.
const FRAME_PERIOD: f64 = 1.0 / 30.0;

/// The time of the last frame that was fused.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FrameClock {
    pub(crate) last: Option<f64>,
    /// Whether any frame came with its time.
    pub(crate) stamped: bool,
}

impl FrameClock {
    /// After a frame of unknown time: none passes, once a frame has come with its time.
    pub(crate) fn next(self) -> Self {
        let time = self.last.map_or(0.0, |last| if self.stamped { last } else { last + FRAME_PERIOD });
        Self { last: Some(time), ..self }
    }

    /// After a frame that was taken at `time`.
    pub(crate) fn at(self, time: f64) -> Result<Self, Error> {
        let last = self.last.unwrap_or(f64::MIN);
        if !(time.is_finite() && time > last) {
            return Err(Error::InvalidTime { time, last });
        }
        Ok(Self { last: Some(time), stamped: true })
    }

    /// Seconds; 0 before the first frame.
    pub(crate) fn time(self) -> f64 {
        self.last.unwrap_or(0.0)
    }
}
