//! How the painted surface looks: where a ray hits it, and at its vertices.

use paint_net::Image;
use paint_sim::render::Shading;
use paint_sim::surface::Hit;
use uv_param::SurfacePoint;

use super::painting_task::PaintingTask;

/// Shading of a point of the world: painted and smooth on the disk, grey elsewhere.
pub(super) fn shading(task: &PaintingTask, painted: &Image, hit: &Hit) -> Shading {
    shading_by(task, hit, &|x, y| task.appearance.linear(bilinear(painted, x, y)))
}

/// The same where the three pictures are the linear sRGB of the surface.
pub(super) fn shading_of_colours(task: &PaintingTask, linear: &[Image; 3], hit: &Hit) -> Shading {
    shading_by(task, hit, &|x, y| linear.each_ref().map(|channel| bilinear(channel, x, y)))
}

/// `colour` gives linear sRGB at a place of the chart, in pixels.
fn shading_by(task: &PaintingTask, hit: &Hit, colour: &dyn Fn(f64, f64) -> [f64; 3]) -> Shading {
    let Some(face) = task.surface.disk().faces().get(hit.face as usize) else {
        return Shading { albedo: [0.4; 3], normal: hit.normal };
    };
    let [u, v] = place(task, *face, hit).map(|m| m / task.settings.texel);
    let (x, y) = (u - 0.5, task.surface.height() as f64 - v - 0.5);
    let [a, b] = hit.barycentric;
    let albedo = colour(x, y).map(|c| c as f32);
    let at = SurfacePoint { face: hit.face, barycentric: [1.0 - a - b, a, b] };
    Shading { albedo, normal: task.surface.chart.smooth_normal(at).into_inner() }
}

/// Colour of every vertex of the disk with `depth` of paint on its texels.
pub(super) fn vertex_colours(task: &PaintingTask, depth: &Image) -> Vec<[u8; 3]> {
    let texel = task.settings.texel;
    let (width, height) = (depth.width(), depth.height());
    let at = |uv: &[f64; 2]| {
        let x = ((uv[0] / texel) as usize).min(width - 1);
        let y = (((height as f64 * texel - uv[1]) / texel) as usize).min(height - 1);
        task.appearance.srgb(depth.at(x, y))
    };
    task.surface.chart.uv().iter().map(at).collect()
}

/// The texel that a ray hits; `None` beside the disk.
pub(super) fn texel_at(task: &PaintingTask, hit: &Hit) -> Option<usize> {
    let face = task.surface.disk().faces().get(hit.face as usize)?;
    let [u, v] = place(task, *face, hit).map(|m| m / task.settings.texel);
    let (width, height) = (task.surface.width(), task.surface.height());
    let (x, y) = ((u as usize).min(width - 1), ((height as f64 - v).max(0.0) as usize).min(height - 1));
    Some(y * width + x)
}

/// Where on the chart a ray hits, metres from its lower left corner.
fn place(task: &PaintingTask, face: [u32; 3], hit: &Hit) -> [f64; 2] {
    let uv = task.surface.chart.uv();
    let [a, b] = hit.barycentric;
    let [p, q, r] = face.map(|i| uv[i as usize]);
    [0, 1].map(|k| (1.0 - a - b) * p[k] + a * q[k] + b * r[k])
}

fn bilinear(image: &Image, x: f64, y: f64) -> f64 {
    let (w, h) = (image.width(), image.height());
    let (x, y) = (x.clamp(0.0, (w - 1) as f64), y.clamp(0.0, (h - 1) as f64));
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let (fx, fy) = (x - x0 as f64, y - y0 as f64);
    let row = |y: usize| image.at(x0, y) * (1.0 - fx) + image.at(x1, y) * fx;
    row(y0) * (1.0 - fy) + row(y1) * fy
}
