//! SLAM on a folder of one's own: `depth/*.png` (16 bits, 5000 per metre) and `rgb/*.png`, paired in the order of their names.

use std::error::Error;
use std::path::{Path, PathBuf};

use tsdf_hash::mesh::write_ply;
use tsdf_hash::slam::{Event, Slam, SlamSettings, SlamState, trajectory_to_tum};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};

fn images(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    files.sort();
    Ok(files)
}

pub(crate) fn slam(folder: &Path, intrinsics: Intrinsics) -> Result<SlamState, Box<dyn Error>> {
    let mut slam = Slam::new(SlamSettings::default())?;
    for (k, (depth, rgb)) in images(&folder.join("depth"))?.iter().zip(images(&folder.join("rgb"))?).enumerate() {
        let (depth, rgb) = (image::open(depth)?.into_luma16(), image::open(rgb)?.into_rgb8());
        let (width, height) = (depth.width() as usize, depth.height() as usize);
        let depth = DepthView { width, height, data: DepthData::U16 { data: &depth, scale: 5000.0 }, intrinsics };
        let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb), intrinsics };
        let outcome = slam.frame(k as f64 / 30.0, &depth, Some(&colour), None)?;
        for event in outcome.events.iter().filter(|event| !matches!(event, Event::Placed(_))) {
            println!("frame {k}: {event:?}");
        }
    }
    let state = slam.finish()?;
    std::fs::write(folder.join("trajectory.txt"), trajectory_to_tum(&state.trajectory))?;
    write_ply(&state.map.mesh(), std::fs::File::create(folder.join("mesh.ply"))?)?;
    Ok(state)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: slam FOLDER")?;
    let state = slam(folder.as_ref(), Intrinsics { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 })?;
    println!("{} frames have a pose: trajectory.txt, mesh.ply", state.trajectory.len());
    Ok(())
}
