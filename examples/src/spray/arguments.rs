//! The command line of `spray`.

use std::path::PathBuf;

use clap::Parser;

use crate::air::{MovingAir, parse_wind};
use crate::mesh_frame::MeshScale;
use crate::mission_arguments::ShowingArguments;
use crate::wall::Wall;

/// Sprays a recorded motion of a nozzle onto a mesh: the painted mesh, pictures, and what became of the paint.
#[derive(Debug, Clone, Parser)]
#[command(
    version,
    after_help = "Example:\n  spray --mesh wall.obj --nozzle arm.csv --paint ultramarine --wall white --out out/arm"
)]
pub struct Arguments {
    /// Surface, OBJ, glTF (.glb, .gltf), PLY, STL or OFF; the built-in rock wall if not given
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Motion: CSV with `time_s`, `nozzle_x_m`, `nozzle_y_m`, `nozzle_z_m`, `axis_x`, `axis_y`, `axis_z`, `nozzle_flow_m3_per_s` (as trajectory.csv), or
    /// MCAP with the transforms or poses of the nozzle, x along the spray, and a joint called valve
    #[arg(long, value_name = "FILE")]
    pub nozzle: PathBuf,
    /// One flow for all of the motion, litres per minute [default: the recorded one]
    #[arg(long, value_name = "L_PER_MIN", value_parser = positive)]
    pub flow: Option<f64>,
    /// What is sprayed: charcoal, red, yellow, green, blue, white, an artists' pigment ("phthalo blue"), or a file of paints, of which the first
    #[arg(long, value_name = "NAME|FILE", default_value = "charcoal")]
    pub paint: String,
    /// The wall: sandstone, white, concrete, dark, or a colour as #rrggbb
    #[arg(long, default_value = "sandstone")]
    pub wall: Wall,
    /// Metres per unit of the mesh file, or m, cm, mm, ft, in, or fit [default: what the file says, else what its size tells]
    #[arg(long, value_name = "METRES|UNIT|fit", allow_negative_numbers = true)]
    pub scale: Option<MeshScale>,
    /// The motion was recorded before the mesh as missions place it, not in the coordinates of its file
    #[arg(long)]
    pub placed: bool,
    /// Size of a texel, metres
    #[arg(long, value_name = "METRES", value_parser = positive, default_value = "0.0125")]
    pub texel: f64,
    /// Standard deviation of the spray 10 cm before the nozzle, metres
    #[arg(long, value_name = "METRES", value_parser = positive, default_value = "0.025")]
    pub spot: f64,
    /// Wind in which the spray drifts, m/s in the coordinates of the motion, and the deviation of its fluctuations [default: it flies straight]
    #[arg(long, value_name = "X,Y,Z[,TURBULENCE]", value_parser = parse_wind, allow_negative_numbers = true)]
    pub wind: Option<MovingAir>,
    /// Spray and cast the rays of the pictures on a GPU: the same files (needs the feature `gpu`; with --wind the processor sprays)
    #[arg(long)]
    pub gpu: bool,
    /// How it is shown.
    #[command(flatten)]
    pub showing: ShowingArguments,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/spray")]
    pub out: PathBuf,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| "give a positive number".to_owned())
}
