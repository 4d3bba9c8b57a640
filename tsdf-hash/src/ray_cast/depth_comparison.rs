//! A view of the map beside a depth image from the same place: does the map show what the camera saw?

use crate::images::{DepthData, DepthView};
use crate::ray_cast::view::View;

/// A view of the map beside a depth image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthComparison {
    /// Mean distance between the depth cast and the depth measured, over the pixels that have both, metres.
    pub mean_error: f64,
    /// Share of the measured pixels at which the map has a surface.
    pub fill: f64,
}

impl View {
    /// Compares the view with a depth image of the same camera and pose, where that measured within a range, metres; `None` if the map has
    /// no surface where the image has one.
    pub fn compare(&self, depth: &DepthView, [nearest, farthest]: [f64; 2]) -> Option<DepthComparison> {
        let measured = |at: usize| match depth.data {
            DepthData::U16 { data, .. } if data[at] == u16::MAX => 0.0,
            DepthData::U16 { data, scale } => f64::from(data[at]) / scale,
            DepthData::F32 { data } => f64::from(data[at]),
        };
        let (mut pixels, mut hits, mut error) = (0_usize, 0_usize, 0.0);
        for (at, seen) in self.depth.iter().enumerate().take(depth.width * depth.height) {
            let z = measured(at);
            // A comparison that a NaN fails.
            if !(z >= nearest && z <= farthest) {
                continue;
            }
            pixels += 1;
            if *seen > 0.0 {
                hits += 1;
                error += (f64::from(*seen) - z).abs();
            }
        }
        (hits > 0).then(|| DepthComparison { mean_error: error / hits as f64, fill: hits as f64 / pixels as f64 })
    }
}
