//! The command line of `unwrap`.

use std::path::PathBuf;

use clap::Parser;

use crate::mesh_frame::MeshScale;
use crate::region::Region;

/// Lays a mesh out in metres: cuts it into few charts that are hardly stretched, packs them onto pages, writes OBJ, glTF, a
/// picture of the charts and a report.
#[derive(Debug, Clone, Parser)]
#[command(version, after_help = "Example:\n  unwrap --mesh statue.obj --texel 0.0125 --out out/statue")]
pub struct Arguments {
    /// Surface, OBJ, glTF (.glb, .gltf), PLY, STL or OFF
    #[arg(long, value_name = "FILE")]
    pub mesh: PathBuf,
    /// Side of a texel on the surface, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.0125)]
    pub texel: f64,
    /// Metres per unit of the mesh file, or m, cm, mm, ft, in, or fit (the longest side becomes 3 m) [default: what the file says, else what its
    /// size tells]
    #[arg(long, value_name = "METRES|UNIT|fit", allow_negative_numbers = true)]
    pub scale: Option<MeshScale>,
    /// Stretch that 99 % of the faces may not exceed [default: 1.15, relaxed up to 2 where that saves more seams than it stretches]
    #[arg(long)]
    pub max_stretch: Option<f64>,
    /// Stretch that no face may exceed
    #[arg(long, default_value_t = 1.5)]
    pub worst_stretch: f64,
    /// Edges that shall be seams: a text file with two vertex numbers, counted from 0, on each line
    #[arg(long, value_name = "FILE")]
    pub seams: Option<PathBuf>,
    /// Picture on the mesh's own texture coordinates (OBJ, glTF): it is carried over to the new ones [default: the pictures that
    /// the mesh file or its MTL names]
    #[arg(long, value_name = "PNG")]
    pub texture: Option<PathBuf>,
    /// Direction of the mesh file that points up in every chart; charts are not turned then
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    pub up: Option<[f64; 3]>,
    /// Lay out only a part of the mesh, in the coordinates of its file: box:x0,y0,z0,x1,y1,z1, plane:px,py,pz,nx,ny,nz,RADIUS,
    /// pick:px,py,pz (as far as no crease), or mask:PNG on its texture coordinates
    #[arg(long)]
    pub region: Option<Region>,
    /// Folder that an earlier state of the mesh was laid out to: charts that did not change stay as they are, at the same texels
    #[arg(long, value_name = "DIR")]
    pub previous: Option<PathBuf>,
    /// Texels between two charts
    #[arg(long, default_value_t = 4)]
    pub gutter: usize,
    /// Columns and rows of a page, texels [default: one page, the smallest rectangle that was found]
    #[arg(long, value_name = "W,H", value_parser = page)]
    pub page: Option<[usize; 2]>,
    /// Share of the pages, above 0 and below 1, that charts shall fill: they are cut into pieces that lie closer together until they do, or no cut
    /// gains enough [default: no chart is cut for the page]
    #[arg(long, value_name = "SHARE")]
    pub utilisation: Option<f64>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/unwrap")]
    pub out: PathBuf,
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|w| w.trim().parse().ok()).filter(|x: &f64| x.is_finite()).collect();
    match numbers[..] {
        [x, y, z] if text.split(',').count() == 3 && numbers.iter().any(|&c| c != 0.0) => Ok([x, y, z]),
        _ => Err("expected X,Y,Z, three finite numbers that are not all zero".into()),
    }
}

fn page(text: &str) -> Result<[usize; 2], String> {
    let sides: Vec<usize> = text.split(',').filter_map(|w| w.trim().parse().ok()).collect();
    match sides[..] {
        [width, height] if width > 0 && height > 0 && text.split(',').count() == 2 => Ok([width, height]),
        _ => Err("expected W,H, two whole numbers above 0".into()),
    }
}
