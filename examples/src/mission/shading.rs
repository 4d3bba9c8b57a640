//! How the painted surface looks: where a ray hits it, and at its vertices.

use paint_net::Image;
use paint_sim::render::Shading;
use paint_sim::surface::Hit;
use uv_param::SurfacePoint;

use super::painting_task::PaintingTask;

/// Shading of a point of the world: painted and smooth on the disk, in the colours of the mesh elsewhere.
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
        return Shading::matt(task.surroundings.albedo(hit), hit.normal);
    };
    let [u, v] = place(task, *face, hit).map(|m| m / task.settings.texel);
    let (x, y) = (u - 0.5, task.surface.height() as f64 - v - 0.5);
    let [a, b] = hit.barycentric;
    let albedo = colour(x, y).map(|c| c as f32);
    let at = SurfacePoint { face: hit.face, barycentric: [1.0 - a - b, a, b] };
    let normal = task.surface.chart.smooth_normal(at).into_inner();
    Shading { albedo, normal, coat: task.varnish }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Design;
    use crate::mesh_io::TriangleMesh;
    use crate::mission::settings::MissionSettings;
    use crate::region::Scene;
    use nalgebra::{Point3, UnitVector3, Vector3};

    /// A wall of 2 m by 1 m at x = 0, from one to two metres up, seen from smaller x.
    fn task() -> PaintingTask {
        let corner = |k: u32| [0.0, 1.0 - 0.25 * (k % 9) as f32, 1.0 + 0.25 * (k / 9) as f32];
        let quad = |a: u32| [[a, a + 1, a + 10], [a, a + 10, a + 9]];
        let faces = (0..32).flat_map(|k| quad(9 * (k / 8) + k % 8)).collect();
        let mesh = TriangleMesh { positions: (0..45).map(corner).collect(), faces, ..TriangleMesh::default() };
        PaintingTask::new("wall", &Scene::whole(mesh), &Design::Gradient, MissionSettings::default()).unwrap()
    }

    /// Paint on the upper left quarter of the picture, and at all places of the surface.
    #[test]
    fn paint_is_shown_where_it_lies() {
        let task = task();
        let mut depth = task.wanted.map(|_| 0.0);
        let (width, height) = (depth.width(), depth.height());
        for y in 0..height / 2 {
            for x in 0..width / 2 {
                depth.data_mut()[y * width + x] = 1.0;
            }
        }
        // Left of the viewer, who looks along x, is y > 0.
        let painted = |p: [f64; 3]| p[1] > 0.0 && p[2] > 1.5;
        let near_border = |p: [f64; 3]| p[1].abs() < 0.03 || (p[2] - 1.5).abs() < 0.03;
        let [bare, full] = [0.0, 1.0].map(|depth| task.appearance.srgb(depth));
        let mut seen = [0; 2];
        for (colour, position) in vertex_colours(&task, &depth).iter().zip(task.surface.disk().positions()) {
            if !near_border(*position) {
                seen[usize::from(painted(*position))] += 1;
                assert_eq!(*colour, if painted(*position) { full } else { bare }, "{position:?}");
            }
        }
        assert!(seen[0] > 10 && seen[1] > 4, "{seen:?}");

        let linear = [0.0, 1.0].map(|depth| task.appearance.linear(depth).map(|c| c as f32));
        let channels = [0, 1, 2].map(|c| depth.map(|depth| task.appearance.linear(depth)[c]));
        let axis = UnitVector3::new_unchecked(Vector3::x());
        for k in 0..200 {
            let at = [-1.0, 1.98 * f64::from(k % 20) / 19.0 - 0.99, 1.01 + 0.98 * f64::from(k / 20) / 9.0];
            let hit = paint_sim::Surface::cast(&task.surface.world, &Point3::from(at), &axis, 2.0).unwrap();
            let texel = texel_at(&task, &hit).unwrap();
            let centre = task.surface.texels.at(texel % width, texel / width).map(|at| task.surface.chart.point(at));
            let off = centre.unwrap() - Point3::new(0.0, at[1], at[2]);
            assert!(off.norm() < task.settings.texel, "{at:?}: {off}");
            if !near_border(at) {
                for shading in [shading(&task, &depth, &hit), shading_of_colours(&task, &channels, &hit)] {
                    assert_eq!(shading.albedo, linear[usize::from(painted(at))], "{at:?}");
                    assert!((shading.normal + Vector3::x()).norm() < 1e-6);
                }
            }
        }
        // The corners of the wall, where texels end.
        for (face, corners) in (0_u32..).zip(task.surface.disk().faces()) {
            for (corner, vertex) in corners.iter().enumerate() {
                let barycentric = [f64::from(u8::from(corner == 1)), f64::from(u8::from(corner == 2))];
                let texel = texel_at(&task, &Hit { face, barycentric, distance: 1.0, normal: -Vector3::x() }).unwrap();
                let centre =
                    task.surface.texels.at(texel % width, texel / width).map(|at| task.surface.chart.point(at));
                let off = centre.unwrap() - Point3::from(task.surface.disk().positions()[*vertex as usize]);
                assert!(off.norm() < task.settings.texel, "{vertex}: {off}");
            }
        }
        let beside = Hit {
            face: 1000,
            ..paint_sim::Surface::cast(&task.surface.world, &Point3::new(-1.0, 0.0, 1.5), &axis, 2.0).unwrap()
        };
        assert_eq!(shading(&task, &depth, &beside).albedo, [0.4; 3]);
        assert_eq!(texel_at(&task, &beside), None);
    }
}
