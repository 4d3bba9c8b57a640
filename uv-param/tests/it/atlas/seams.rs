//! What lies beyond the seams of an atlas, texel by texel and along a line.

use uv_param::atlas::{AtlasQuality, PageTexels, TexelKind};
use uv_param::nalgebra::Vector3;
use uv_param::texture::{Gutter, TexelMap};
use uv_param::{SurfacePoint, unwrap_atlas};

use super::{atlas, cube, settings, sphere};
use crate::common::{Rng, grid};

/// A smooth function, sampled into the page and read back bilinearly, is the same on the two sides of every seam: far nearer
/// than with gutters that repeat the rim.
#[test]
fn gutters_continue_what_lies_beyond_the_seam() {
    let mesh = sphere(12);
    let texel_m = 0.02;
    let found = atlas(&mesh, texel_m);
    let value = |p: [f64; 3]| (6.0 * p[0] + 1.0).sin() + (5.0 * p[1] - 3.0 * p[2]).cos();
    let surface = found.surface();
    let at = |point: SurfacePoint| {
        let corners = surface.faces()[point.face as usize].map(|v| surface.positions()[v as usize]);
        [0, 1, 2].map(|k| (0..3).map(|c| point.barycentric[c] * corners[c][k]).sum::<f64>())
    };
    let page = &PageTexels::of(&found, 2)[0];
    let image = page.fill(f64::NAN, |point| value(at(point)));
    let bare: Vec<f64> =
        image.iter().zip(&page.kinds).map(|(v, kind)| if *kind == TexelKind::Inside { *v } else { f64::NAN }).collect();
    let sample = |image: &[f64], uv: [f64; 2]| {
        let (x, y) = (uv[0] / texel_m - 0.5, page.height as f64 - uv[1] / texel_m - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (mut sum, mut weight) = (0.0, 0.0);
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let w = (1.0 - (x - left - dx).abs()) * (1.0 - (y - top - dy).abs());
            let (column, row) = (left + dx, top + dy);
            let inside = column >= 0.0 && row >= 0.0 && column < page.width as f64 && row < page.height as f64;
            let v = if inside { image[row as usize * page.width + column as usize] } else { f64::NAN };
            if v.is_finite() {
                sum += w * v;
                weight += w;
            }
        }
        sum / weight
    };
    let within = |uv: [f64; 2]| {
        let size = [page.width, page.height].map(|texels| (texels as f64 - 0.5) * texel_m);
        (0..2).all(|k| uv[k] >= 0.5 * texel_m && uv[k] <= size[k])
    };
    let (mut error, mut without, mut count) = (0.0_f64, 0.0_f64, 0);
    for h in 0..3 * surface.faces().len() {
        let Some(twin) = surface.twin(h) else { continue };
        let on = |h: usize, t: f64| {
            let mut barycentric = [0.0; 3];
            (barycentric[h % 3], barycentric[(h + 1) % 3]) = (1.0 - t, t);
            SurfacePoint { face: (h / 3) as u32, barycentric }
        };
        for t in [0.2, 0.5, 0.8] {
            let (here, there) = (on(h, t), on(twin, 1.0 - t));
            let (one, other) = (found.uv_of(here).1, found.uv_of(there).1);
            if (one[0] - other[0]).hypot(one[1] - other[1]) < 1e-6 {
                continue;
            }
            // Charts reach up to the rim of a page: nothing can lie in a gutter beyond it.
            if [one, other].iter().any(|uv| !within(*uv)) {
                continue;
            }
            error = error.max((sample(&image, one) - sample(&image, other)).abs());
            without = without.max((sample(&bare, one) - sample(&bare, other)).abs());
            count += 1;
        }
    }
    assert!(count > 100);
    // The interpolation error of the function itself: h^2 f'' / 8 on each axis and side, and what the stretch adds.
    assert!(error < 0.02, "{error}");
    assert!(without > 3.0 * error, "{without} against {error}");
}

/// A page as one chart: the same places, every texel found again, and normals that do not jump at seams.
#[test]
fn a_page_is_a_chart_of_charts() {
    let found = atlas(&sphere(12), 0.02);
    let page = found.page_chart(0).unwrap();
    assert!(found.page_chart(1).is_none());
    assert_eq!(page.width(), found.pages()[0][0] as f64 * 0.02);
    let q = page.quality();
    assert_eq!((q.flips, q.overlap_pairs), (0, 0));
    assert!((q.seam_length_m - AtlasQuality::of(&found).seam_length_m).abs() < 1e-9);
    let texels = TexelMap::new(&page, 0.02).unwrap();
    assert_eq!([texels.width, texels.height], found.pages()[0]);
    assert!((texels.area_m2.iter().sum::<f64>() - q.area_m2).abs() < 1e-9);
    let middle = [1.0 / 3.0; 3];
    for face in 0..page.disk().faces().len() {
        let at = SurfacePoint { face: face as u32, barycentric: middle };
        assert_eq!(found.uv_of(at).1.map(|x| (1e9 * x).round()), page.uv_of(at).map(|x| (1e9 * x).round()));
        assert_eq!(page.locate(page.uv_of(at)).unwrap().face, face as u32);
    }
    let mut seams = 0;
    for h in 0..3 * page.disk().faces().len() {
        let Some(other) = page.disk().across_seam(h) else { continue };
        let half = |h: usize| {
            let mut barycentric = [0.5; 3];
            barycentric[(h + 2) % 3] = 0.0;
            SurfacePoint { face: (h / 3) as u32, barycentric }
        };
        assert!((page.point(half(h)) - page.point(half(other))).norm() < 1e-12);
        assert!(
            (page.smooth_normal(half(h)).into_inner() - page.smooth_normal(half(other)).into_inner()).norm() < 1e-9
        );
        seams += 1;
    }
    assert!(seams > 20);
}

/// Straight on from a point of a cube, computed on the cube itself: over an edge the way turns by a right angle.
#[test]
fn a_straight_line_goes_on_over_seams() {
    let found = atlas(&cube(4), 0.02);
    let page = found.page_chart(0).unwrap();
    let mut random = Rng(5);
    let (mut crossed, mut seams) = (0, 0);
    for _ in 0..2000 {
        let from = SurfacePoint {
            face: random.below(page.disk().faces().len()) as u32,
            barycentric: {
                let (a, b) = (random.unit(), random.unit());
                if a + b < 1.0 { [a, b, 1.0 - a - b] } else { [1.0 - a, 1.0 - b, a + b - 1.0] }
            },
        };
        let (angle, length) = (6.3 * random.unit(), 0.1 + 0.8 * random.unit());
        let offset = [length * angle.cos(), length * angle.sin()];
        // The direction in space, by the corners of the face.
        let corners = page.disk().faces()[from.face as usize];
        let place = |k: usize| Vector3::from(page.disk().positions()[corners[k] as usize]);
        let uv = |k: usize| page.uv()[corners[k] as usize];
        let [[a, b], [c, d]] = [1, 2].map(|k| [uv(k)[0] - uv(0)[0], uv(k)[1] - uv(0)[1]]);
        let det = a * d - b * c;
        let (s, t) = ((offset[0] * d - offset[1] * c) / det, (a * offset[1] - b * offset[0]) / det);
        let mut way = s * (place(1) - place(0)) + t * (place(2) - place(0));
        assert!((way.norm() - length).abs() < 1e-9, "a cube is laid out without stretch");
        let mut point = page.point(from).coords;
        let mut normal = page.face_normal(from.face).into_inner();
        let middle = Vector3::repeat(0.5);
        let mut folds = 0;
        loop {
            // How far to the next edge of this side of the cube, and over which.
            let to_edge = |k: usize| {
                let room = if way[k] > 0.0 { 1.0 - point[k] } else { -point[k] };
                if normal[k].abs() > 0.5 || way[k].abs() < 1e-12 { f64::INFINITY } else { room / way[k] }
            };
            let first = (0..3).min_by(|&i, &j| to_edge(i).total_cmp(&to_edge(j))).unwrap();
            let share = to_edge(first);
            if share >= 1.0 {
                point += way;
                break;
            }
            point += share * way;
            let mut out = Vector3::zeros();
            out[first] = way[first].signum();
            let rest = (1.0 - share) * way;
            way = rest - rest.dot(&out) * out - rest.dot(&out) * normal;
            normal = out;
            folds += 1;
        }
        let reached = page.straight_on(from, offset).expect("a cube has no border");
        assert!((page.point(reached).coords - point).norm() < 1e-9, "{reached:?} from {from:?} by {offset:?}");
        assert!((point - middle).amax() < 0.5 + 1e-9);
        crossed += usize::from(folds > 0);
        let flat = page.uv_of(from);
        seams += usize::from(page.locate([flat[0] + offset[0], flat[1] + offset[1]]) != Some(reached));
    }
    assert!(crossed > 500 && seams > 100, "{crossed} crossed an edge of the cube, {seams} a seam");
}

/// A gutter texel of a cube lies on another side of it, as far from the seam as on the page; and what it interpolates is that place.
#[test]
fn the_gutter_is_the_other_side_of_the_seam() {
    let texel = 0.02;
    let found = atlas(&cube(4), texel);
    let page = found.page_chart(0).unwrap();
    let map = TexelMap::new(&page, texel).unwrap();
    let gutter = Gutter::new(&page, &map, 3);
    let open: Vec<usize> = (0..3 * page.disk().faces().len()).filter(|&h| page.disk().twin(h).is_none()).collect();
    let corner = |h: usize| page.disk().faces()[h / 3][h % 3] as usize;
    let mut checked = 0;
    for gutter in &gutter.texels {
        let centre = map.uv_of_texel(gutter.texel % map.width, gutter.texel / map.width);
        assert!(page.locate(centre).is_none());
        // The nearest point of the rim, in the plane and on the cube.
        let nearest = open.iter().map(|&h| {
            let ends = [h, h / 3 * 3 + (h + 1) % 3].map(corner);
            let [a, b] = ends.map(|v| page.uv()[v]);
            let edge = [b[0] - a[0], b[1] - a[1]];
            let along = ((centre[0] - a[0]) * edge[0] + (centre[1] - a[1]) * edge[1]) / edge[0].hypot(edge[1]).powi(2);
            let along = along.clamp(0.0, 1.0);
            let distance = (a[0] + along * edge[0] - centre[0]).hypot(a[1] + along * edge[1] - centre[1]);
            let [p, q] = ends.map(|v| Vector3::from(page.disk().positions()[v]));
            (distance, p + along * (q - p))
        });
        let rims: Vec<(f64, Vector3<f64>)> = nearest.collect();
        let distance = rims.iter().map(|(distance, _)| *distance).fold(f64::INFINITY, f64::min);
        // In the middle of a cut both of its sides are the nearest.
        let rims: Vec<Vector3<f64>> =
            rims.into_iter().filter(|(d, _)| *d < distance + 1e-9).map(|(_, rim)| rim).collect();
        // Off the corners of the cube, where nothing unfolds, and off its other edges, where the way would bend again.
        let bends = |rim: &Vector3<f64>| {
            let to_edge = rim.map(|x| x.min(1.0 - x));
            to_edge.iter().any(|x| (1e-9..0.08).contains(x)) || to_edge.iter().all(|x| *x < 1e-9)
        };
        if rims.iter().any(bends) {
            continue;
        }
        let point = page.point(gutter.point).coords;
        let is_beyond = |rim: &Vector3<f64>| ((point - rim).norm() - distance).abs() < 1e-9;
        assert!(rims.iter().any(is_beyond), "{point} beyond {rims:?}, {distance} m");
        let sum: f64 = gutter.sources.iter().map(|s| s.1).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        let shown: Vector3<f64> =
            gutter.sources.iter().map(|&(k, weight)| weight * page.point(map.cells[k].unwrap()).coords).sum();
        // A texel that straddles the edge of the cube has its middle on one of the sides.
        assert!((shown - point).norm() < texel, "shows {shown} for {point}");
        checked += 1;
    }
    assert!(checked > 500, "{checked}");
}

/// A wall that is cut into strips: a gutter texel that shows a place near the rim takes what it lies between from both sides of the seam, and
/// errs by little more than half of what it would if it took the nearer side alone.
#[test]
fn places_near_a_rim_are_interpolated_from_both_sides() {
    // Strips of 20.4 texels: beside a rim lie centres that are hardly beyond it.
    let texel = 0.0126;
    let mesh = grid(8, 6, |s, t| [1.03 * s, 0.0, 0.7 * t]);
    let seam: Vec<[u32; 2]> =
        [2, 4, 6].iter().flat_map(|k| (0..6).map(move |row| [9 * row + k, 9 * (row + 1) + k])).collect();
    let found = unwrap_atlas(&mesh.0, &mesh.1, &seam, &settings(texel), |_| ()).unwrap();
    assert_eq!(found.charts().len(), 4);
    let page = found.page_chart(0).unwrap();
    let map = TexelMap::new(&page, texel).unwrap();
    let centre = |k: usize| map.uv_of_texel(k % map.width, k / map.width);
    let (mut both, mut one, mut count) = (0.0, 0.0, 0);
    for gutter in &Gutter::new(&page, &map, 4).texels {
        let truth = page.point(gutter.point).coords;
        // Around the place, what lies in the chart itself.
        let at = page.uv_of(gutter.point);
        let share = |k: usize| {
            let off = [0, 1].map(|c| 1.0 - ((centre(k)[c] - at[c]) / texel).abs());
            off[0].max(0.0) * off[1].max(0.0)
        };
        let own: Vec<(f64, Vector3<f64>)> = (0..map.cells.len())
            .filter(|&k| share(k) > 0.0)
            .filter_map(|k| Some((share(k), page.point(page.locate(centre(k))?).coords)))
            .collect();
        let sum: f64 = own.iter().map(|(weight, _)| weight).sum();
        if !(1e-9..=1.0 - 1e-9).contains(&sum) {
            continue;
        }
        let nearer: Vector3<f64> = own.iter().map(|(weight, place)| place * (*weight / sum)).sum();
        let shown: Vector3<f64> =
            gutter.sources.iter().map(|&(k, weight)| weight * page.point(map.cells[k].unwrap()).coords).sum();
        both += (shown - truth).norm();
        one += (nearer - truth).norm();
        count += 1;
    }
    assert!(count > 30, "{count}");
    assert!(both < 0.6 * one, "{} texels against {}", both / texel / f64::from(count), one / texel / f64::from(count));
}

/// A footprint over an edge of a cube sees the side beyond as far as it reaches there, also over a seam: the mean of two normals, by the area of the
/// segment of the disc.
#[test]
fn footprints_reach_over_seams() {
    let found = atlas(&cube(4), 0.02);
    let page = found.page_chart(0).unwrap();
    let mut random = Rng(8);
    let (radius, mut checked, mut seams) = (0.15_f64, 0, 0);
    while checked < 200 {
        let face = random.below(page.disk().faces().len()) as u32;
        let at = SurfacePoint { face, barycentric: [1.0 / 3.0; 3] };
        let (point, normal) = (page.point(at).coords, page.face_normal(face).into_inner());
        // The edges of this side that are nearer than the radius: the way to each, and how far.
        let near: Vec<(Vector3<f64>, f64)> = (0..3)
            .filter(|k| normal[*k].abs() < 0.5)
            .flat_map(|k| [(k, 1.0, 1.0 - point[k]), (k, -1.0, point[k])])
            .filter(|(_, _, room)| *room < radius)
            .map(|(k, sign, room)| (Vector3::ith(k, sign), room))
            .collect();
        let [(out, room)] = near[..] else { continue };
        let share =
            ((room / radius).acos() - room / radius * (1.0 - (room / radius).powi(2)).sqrt()) / std::f64::consts::PI;
        let expected = (normal * (1.0 - share) + out * share).normalize();
        let seen = page.footprint_normal(at, radius).into_inner();
        assert!((seen - expected).norm() < 0.05, "{seen} for {expected}, {room} m from the edge");
        let uv = page.uv_of(at);
        seams += usize::from((0..24).any(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / 24.0;
            page.locate([uv[0] + radius * angle.cos(), uv[1] + radius * angle.sin()]).is_none()
        }));
        checked += 1;
    }
    assert!(seams > 20, "{seams}");
}
