//! The painted surface as a mesh: with colours at its vertices, and with the paint as its texture.

use std::path::Path;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::written_file::unwritable;
use crate::mesh_io::{PlyMesh, write_ply};
use crate::textured_mesh::{TexturedMesh, with_gutter};

/// sRGB of every pixel of the page, `None` beside the surface.
pub(super) type PageColours = [Option<[u8; 3]>];

/// Writes `surface.ply`, `painted.glb`, and `painted.obj` with its material; the colours of the vertices.
pub(super) fn save_painted_mesh(
    task: &PaintingTask,
    colours: &PageColours,
    folder: &Path,
) -> Result<Vec<[u8; 3]>, MissionError> {
    let at_vertices = vertex_colours(task, colours);
    let (positions, disk) = (task.surface.vertices(), task.surface.disk());
    let ply = folder.join("surface.ply");
    write_ply(&ply, &PlyMesh { positions: &positions, normals: None, colours: &at_vertices, faces: disk.faces() })
        .map_err(unwritable(&ply))?;
    let (width, height) = (task.surface.width(), task.surface.height());
    let extent = [width, height].map(|side| side as f64 * task.settings.texel);
    let mesh = TexturedMesh {
        positions: disk.positions(),
        faces: disk.faces(),
        origin: [0.0; 3],
        uv: task.surface.chart.uv().iter().map(|uv| [uv[0] / extent[0], uv[1] / extent[1]]).collect(),
        texture: with_gutter(width, height, colours.to_vec()),
    };
    mesh.save(folder, "painted").map_err(unwritable(&folder.join("painted.*")))?;
    Ok(at_vertices)
}

/// The colour of the pixel that every vertex lies in; of the next to it on the page where that is beside the surface.
fn vertex_colours(task: &PaintingTask, colours: &PageColours) -> Vec<[u8; 3]> {
    let texel = task.settings.texel;
    let (width, height) = (task.surface.width(), task.surface.height());
    let at = |uv: &[f64; 2]| {
        let x = ((uv[0] / texel) as usize).min(width - 1);
        let y = (((height as f64 * texel - uv[1]) / texel).max(0.0) as usize).min(height - 1);
        let around = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
        let pixel = |(dx, dy): &(i64, i64)| {
            let (x, y) = (x as i64 + dx, y as i64 + dy);
            let inside = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
            if inside { colours[y as usize * width + x as usize] } else { None }
        };
        around.iter().find_map(pixel).unwrap_or_else(|| task.appearance.srgb(0.0))
    };
    task.surface.chart.uv().iter().map(at).collect()
}
