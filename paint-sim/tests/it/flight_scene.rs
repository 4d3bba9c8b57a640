//! Where the tests fly: before a wall, outdoors.

use nalgebra::Point3;
use paint_sim::flight::HoseModel;
use paint_sim::{FlightSettings, TriangleSurface};

/// A wall in the plane x = 0, painted from -x.
pub(crate) fn wall() -> TriangleSurface {
    let corners = [[0.0, -10.0, -10.0], [0.0, 10.0, -10.0], [0.0, 10.0, 10.0], [0.0, -10.0, 10.0]];
    TriangleSurface::new(&corners, &[[0, 2, 1], [0, 3, 2]]).unwrap()
}

pub(crate) fn paint_hose() -> HoseModel {
    HoseModel { base: Point3::new(-2.5, 0.0, 0.0), length: 5.0, line_density: 0.12, base_on_floor: true }
}

/// Wind of 2 m/s with gusts, hose, motion capture.
pub(crate) fn outdoors(seed: u64) -> FlightSettings {
    FlightSettings { hose: Some(paint_hose()), seed, ..FlightSettings::default() }
}
