//! How the painted surface looks where a ray hits it.

use paint_sim::{Hit, Shading};
use uv_param::SurfacePoint;

use super::run::Mission;

/// Shading of a point of the world: painted and smooth on the disk, grey elsewhere.
pub(super) fn shading(mission: &Mission, painted: &paint_net::Image, hit: &Hit) -> Shading {
    let Some(face) = mission.surface.disk().faces().get(hit.face as usize) else {
        return Shading { albedo: [0.4; 3], normal: hit.normal };
    };
    let uv = mission.surface.chart.uv();
    let [a, b] = hit.barycentric;
    let mix =
        |k: usize| (1.0 - a - b) * uv[face[0] as usize][k] + a * uv[face[1] as usize][k] + b * uv[face[2] as usize][k];
    let texel = mission.settings.texel;
    let x = mix(0) / texel - 0.5;
    let y = (painted.height() as f64 * texel - mix(1)) / texel - 0.5;
    let albedo = mission.appearance.linear(bilinear(painted, x, y)).map(|c| c as f32);
    let at = SurfacePoint { face: hit.face, barycentric: [1.0 - a - b, a, b] };
    Shading { albedo, normal: mission.surface.chart.smooth_normal(at).into_inner() }
}

fn bilinear(image: &paint_net::Image, x: f64, y: f64) -> f64 {
    let (w, h) = (image.width(), image.height());
    let (x, y) = (x.clamp(0.0, (w - 1) as f64), y.clamp(0.0, (h - 1) as f64));
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let (fx, fy) = (x - x0 as f64, y - y0 as f64);
    let row = |y: usize| image.at(x0, y) * (1.0 - fx) + image.at(x1, y) * fx;
    row(y0) * (1.0 - fy) + row(y1) * fy
}
