//! Trains the visual words of `tsdf-hash` on rendered rooms.

use std::error::Error;
use std::path::Path;

use nalgebra::Isometry3;
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
use vio_ekf::sim::{RoomSettings, Scenario, Simulation, painting_flight};

/// Rooms, each with its own paint, furniture and flight.
const ROOMS: u64 = 8;
/// Seconds of a flight, and images of which one is taken: neighbours show the same.
const SECONDS: f64 = 20.0;
const EVERY: usize = 10;

/// Renders the rooms, and writes the words of their corners.
///
/// # Errors
/// If a room cannot be rendered, or the file not be written.
pub fn run(file: &Path, seed: u64) -> Result<(), Box<dyn Error>> {
    let mut keyframes = KeyframeIndex::with_budget(0);
    for room in 0..ROOMS {
        let seed = seed.wrapping_mul(1000).wrapping_add(room);
        // Walls near and far: corners of all sizes.
        let near = 1.0 + 0.5 * room as f64;
        let settings = RoomSettings { wall_distance_m: (near, 2.0 * near), ..RoomSettings::default() };
        let scenario = Scenario { seed, room: settings, ..Scenario::default() };
        let simulation = Simulation::new(painting_flight(seed, SECONDS)?, scenario)?;
        for index in (0..simulation.frame_count(0)).step_by(EVERY) {
            let Some(frame) = simulation.frame(0, index)? else { continue };
            let (width, height) = (frame.width, frame.height);
            // Words know no depth; only where there is some does a corner count.
            let metres = vec![2.0_f32; width * height];
            let rgb: Vec<u8> = frame.data.iter().flat_map(|grey| [*grey; 3]).collect();
            let intrinsics = Intrinsics { fx: 458.0, fy: 457.0, cx: 0.5 * width as f64, cy: 0.5 * height as f64 };
            let depth = DepthView { width, height, data: DepthData::F32 { data: &metres }, intrinsics };
            let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb), intrinsics };
            keyframes.push(&depth, Some(&colour), &Isometry3::identity())?;
        }
    }
    let vocabulary = keyframes.train_vocabulary(seed);
    println!("{} words of {} images", vocabulary.words(), keyframes.len());
    Ok(std::fs::write(file, vocabulary.to_bytes())?)
}
