//! One chart of a wall with a fold: its size in metres, its texels, and where a spray gun must be to paint a point of it.

use uv_param::nozzle::{NozzleSettings, nozzle_command};
use uv_param::texture::TexelMap;
use uv_param::{Chart, Error, Settings, largest_disk, unwrap};

/// A wall of 2 m x 1 m with a right-angled fold, z up.
pub(crate) fn folded_wall() -> Result<Chart, Error> {
    let positions = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 0., 1.], [1., 0., 1.], [1., 1., 1.]];
    let faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
    let (disk, _left_out) = largest_disk(&positions, &faces)?;
    unwrap(&disk, &Settings { up: Some([0.0, 0.0, 1.0]), ..Settings::default() }, |_progress| ())
}

fn main() -> Result<(), Error> {
    let chart = folded_wall()?;
    let texels = TexelMap::new(&chart, 0.0125)?;
    println!("{:.3} m x {:.3} m, {} x {} texels", chart.width(), chart.height(), texels.width, texels.height);
    for u in [0.5, 0.9, 1.1, 1.5] {
        let nozzle = nozzle_command(&chart, [u, 0.25], &NozzleSettings::default())?;
        let [x, y, z] = nozzle.direction.into_inner().into();
        println!("u = {u} m: nozzle at {:.3}, spraying along {x:.3}, {y:.3}, {z:.3}", nozzle.position);
    }
    Ok(())
}
