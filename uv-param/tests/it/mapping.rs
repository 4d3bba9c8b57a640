//! Between the plane and the surface: location, texels, textures, nozzle poses.

use crate::common::{Rng, grid};
use uv_param::disk::{Repair, largest_disk_with};
use uv_param::nalgebra::Vector3;
use uv_param::nozzle::{NormalMode, NozzleSettings, nozzle_command};
use uv_param::texture::{TexelMap, Texture, linear_from_srgb, luminance};
use uv_param::{Chart, Error, Settings, SurfacePoint, unwrap};

fn chart(nx: u32, ny: u32, place: impl Fn(f64, f64) -> [f64; 3]) -> Chart {
    let (positions, faces) = grid(nx, ny, place);
    let (disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    unwrap(&disk, &Settings { up: Some([0.0, 0.0, 1.0]), ..Settings::default() }, |_| ()).unwrap()
}

/// A wavy wall, 2 m x 1.2 m, z up, seen from -y, with a hole.
fn wavy_wall() -> Chart {
    let (positions, mut faces) = grid(40, 24, |s, t| [2.0 * s, 0.1 * (9.0 * s).sin() * (7.0 * t).cos(), 1.2 * t]);
    faces.retain(|f| !(8..13).contains(&(f[0] % 41)) || !(8..14).contains(&(f[0] / 41)));
    let (disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    unwrap(&disk, &Settings { up: Some([0.0, 0.0, 1.0]), ..Settings::default() }, |_| ()).unwrap()
}

/// A flat wall of 2 m x 1 m in the plane y = 0.
fn flat_wall() -> Chart {
    chart(7, 4, |s, t| [2.0 * s, 0.0, t])
}

#[test]
fn a_surface_point_is_found_again() {
    let chart = wavy_wall();
    let mut rng = Rng(3);
    for _ in 0..20_000 {
        let face = rng.below(chart.disk().faces().len()) as u32;
        let (a, b) = (rng.unit(), rng.unit());
        let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
        let at = SurfacePoint { face, barycentric: [1.0 - a - b, a, b] };
        let found = chart.locate(chart.uv_of(at)).unwrap();
        assert!((chart.point(found) - chart.point(at)).norm() < 1e-12);
        if at.barycentric.iter().all(|&w| w > 1e-9) {
            assert_eq!(found.face, face);
            assert!(found.barycentric.iter().zip(at.barycentric).all(|(p, q)| (p - q).abs() < 1e-9));
        }
    }
}

#[test]
fn location_agrees_with_asking_every_face() {
    let chart = wavy_wall();
    let mut rng = Rng(5);
    let mut outside = 0;
    for _ in 0..2000 {
        let p = [chart.width() * (1.2 * rng.unit() - 0.1), chart.height() * (1.2 * rng.unit() - 0.1)];
        let covers = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|v| chart.uv()[v as usize]);
            let side = |q: [f64; 2], r: [f64; 2]| (r[0] - q[0]) * (p[1] - q[1]) - (r[1] - q[1]) * (p[0] - q[0]);
            side(a, b) >= 0.0 && side(b, c) >= 0.0 && side(c, a) >= 0.0
        };
        let expected = chart.disk().faces().iter().position(covers);
        assert_eq!(chart.locate(p).map(|at| at.face as usize), expected);
        outside += usize::from(expected.is_none());
    }
    assert!(outside > 200 && outside < 1500);
    // Every vertex and the middle of every edge is covered: no gaps between faces.
    for (f, face) in chart.disk().faces().iter().enumerate() {
        let corners = face.map(|v| chart.uv()[v as usize]);
        for (k, a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % 3];
            assert!(chart.locate(*a).is_some());
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            // The middle of a boundary edge may round to the outer side of it.
            assert!(chart.locate(middle).is_some() || chart.disk().twin(3 * f + k).is_none());
        }
    }
    for nowhere in [[f64::NAN, 0.1], [0.1, f64::INFINITY], [-1e-9, 0.1], [1e300, 0.1]] {
        assert_eq!(chart.locate(nowhere), None);
    }
}

#[test]
fn texels_share_the_surface_among_them() {
    let chart = wavy_wall();
    for texel in [0.0125, 0.05, 0.3] {
        let map = TexelMap::new(&chart, texel).unwrap();
        let area: f64 = map.area_m2.iter().sum();
        assert!((area / chart.disk().area() - 1.0).abs() < 1e-9, "texels of {texel} m hold {area} m^2");
        for (i, cell) in map.cells.iter().enumerate() {
            assert_eq!(cell.is_some(), map.coverage[i] > 0.0);
            assert!(map.coverage[i] < 1.0 + 1e-5);
            let Some(at) = *cell else { continue };
            // The texel's point lies in the texel, and is its centre wherever the centre is covered.
            let (column, row) = (i % map.width, i / map.width);
            let (uv, centre) = (chart.uv_of(at), map.uv_of_texel(column, row));
            assert!((uv[0] - centre[0]).abs().max((uv[1] - centre[1]).abs()) < 0.5 * texel + 1e-9);
            if let Some(expected) = chart.locate(centre) {
                assert!((chart.point(expected) - chart.point(at)).norm() < 1e-9);
            }
            assert_eq!(map.texel_of_uv(centre), Some([column, row]));
            assert_eq!(map.at(column, row), Some(at));
        }
    }
    let map = TexelMap::new(&chart, 0.1).unwrap();
    assert_eq!(map.texel_of_uv([-0.01, 0.1]), None);
    assert_eq!((map.at(map.width, 0), map.at(0, map.height)), (None, None));
    assert_eq!(
        TexelMap::new(&chart, 0.0).unwrap_err(),
        Error::Setting { name: "texel_m", value: 0.0, must_be: "positive" }
    );
    assert!(matches!(TexelMap::new(&chart, 1e-9), Err(Error::TooManyTexels { .. })));
}

/// Two texels on a wall of 1 m x 0.3 m, neither centre on it: the diagonal leaves more of the upper face in the first and of the lower face in
/// the second, whichever comes first.
#[test]
fn a_texel_without_its_centre_shows_its_largest_piece() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.3], [0.0, 0.0, 0.3]];
    for faces in [[[0, 1, 2], [0, 2, 3]], [[0, 2, 3], [0, 1, 2]]] {
        let (disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
        let up = Settings { up: Some([0.0, 0.0, 1.0]), ..Settings::default() };
        let map = TexelMap::new(&unwrap(&disk, &up, |_| ()).unwrap(), 0.7).unwrap();
        assert_eq!((map.width, map.height), (2, 1));
        let shown = [0, 1].map(|k| {
            let face = disk.faces()[map.cells[k].unwrap().face as usize];
            face.iter().all(|&v| disk.positions()[v as usize] != positions[1])
        });
        assert_eq!(shown, [true, false], "whether it is the upper face");
    }
}

#[test]
fn vertex_colours_that_are_linear_on_a_wall_stay_linear() {
    let chart = flat_wall();
    let map = TexelMap::new(&chart, 0.0125).unwrap();
    assert_eq!((map.width, map.height), (160, 80));
    let colours: Vec<[f32; 3]> =
        chart.disk().positions().iter().map(|p| [0.1 + 0.4 * p[0] as f32, p[2] as f32, 0.5]).collect();
    let texture = Texture::from_vertices(&map, chart.disk(), &colours).unwrap();
    for row in 0..80 {
        for column in 0..160 {
            // Row 0 is the top of the wall.
            let (x, z) = (0.0125 * (column as f32 + 0.5), 1.0 - 0.0125 * (row as f32 + 0.5));
            let [r, g, b] = texture.texels[row * 160 + column];
            assert!((r - 0.1 - 0.4 * x).abs() < 1e-6 && (g - z).abs() < 1e-6 && (b - 0.5).abs() < 1e-6);
        }
    }
    let grey = texture.luminance();
    let [r, g, b] = texture.texels[80];
    assert_eq!(grey.texels[80][0], 0.2126 * r + 0.7152 * g + 0.0722 * b);
    assert_eq!(
        Texture::from_vertices(&map, chart.disk(), &colours[1..]).unwrap_err(),
        Error::Length { what: "vertex values", expected: 40, found: 39 }
    );
    let mut broken = colours;
    broken[7][1] = f32::NAN;
    let refused = Texture::from_vertices(&map, chart.disk(), &broken).unwrap_err();
    assert_eq!(refused, Error::NonFiniteValue { what: "vertex values", index: 7 });
}

#[test]
fn an_image_on_another_layout_is_carried_over() {
    // Input faces with alternating winding, an unused vertex first, and uv of their own per corner: (z, x).
    let (mut positions, faces) = grid(6, 3, |s, t| [2.0 * s, 0.0, t]);
    positions.insert(0, [f64::NAN; 3]);
    let wind = |(i, f): (usize, &[u32; 3])| {
        let [a, b, c] = f.map(|v| v + 1);
        if i % 3 == 1 { [a, c, b] } else { [a, b, c] }
    };
    let faces: Vec<[u32; 3]> = faces.iter().enumerate().map(wind).collect();
    let corner_uv: Vec<[[f32; 2]; 3]> =
        faces.iter().map(|f| f.map(|v| [positions[v as usize][2] as f32, positions[v as usize][0] as f32])).collect();
    let (disk, report) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    assert_eq!(report.reversed_faces, 12);
    let chart = unwrap(&disk, &Settings::default(), |_| ()).unwrap();
    let map = TexelMap::new(&chart, 0.05).unwrap();
    let texture = Texture::from_image(&map, &disk, &corner_uv, |_, [u, v]| [u as f32, v as f32]).unwrap();
    for (cell, value) in map.cells.iter().zip(&texture.texels) {
        let p = chart.point(cell.unwrap());
        assert!((value[0] - p.z as f32).abs() < 1e-6 && (value[1] - p.x as f32).abs() < 1e-6);
    }
    assert!(matches!(
        Texture::<2>::from_image(&map, &disk, &corner_uv[1..], |_, _| [0.0; 2]),
        Err(Error::Length { what: "corner_uv", .. })
    ));
}

#[test]
fn gutters_grow_ring_by_ring() {
    let texels = |rows: [[f32; 1]; 15]| rows.to_vec();
    let mut texture = Texture {
        width: 5,
        height: 3,
        texels: texels([0., 0., 0., 0., 0., 2., 0., 0., 0., 0., 4., 0., 0., 0., 0.].map(|x| [x])),
        filled: (0..15).map(|i| i == 5 || i == 10).collect(),
    };
    texture.dilate(1);
    // Above 2 only the 2 is a neighbour; beside both the mean of both; two columns away nothing yet.
    assert_eq!(texture.texels, texels([2., 2., 0., 0., 0., 2., 3., 0., 0., 0., 4., 3., 0., 0., 0.].map(|x| [x])));
    assert_eq!(texture.filled.iter().filter(|&&f| f).count(), 6);
    texture.dilate(10);
    assert!(texture.filled.iter().all(|&f| f));
}

#[test]
fn light_is_linear() {
    // IEC 61966-2-1 at 8-bit 188 (half the light) and the joint of its two parts.
    assert!((linear_from_srgb(188.0 / 255.0) - 0.5029).abs() < 1e-4);
    assert!((linear_from_srgb(0.04045) - 0.0031308).abs() < 1e-7);
    assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
}

#[test]
fn the_nozzle_stands_off_along_the_normal() {
    // R = 2 sigma = 5 cm: 0.2836 m at 10 degrees, 0.1866 m at 15, 0.1374 m at 20.
    for (degrees, expected) in [(10.0_f64, 0.2836), (15.0, 0.1866), (20.0, 0.1374)] {
        let spray = NozzleSettings { half_angle: degrees.to_radians(), ..NozzleSettings::default() };
        assert!((spray.stand_off() - expected).abs() < 5e-5);
    }
    let chart = flat_wall();
    for normal in [NormalMode::Face, NormalMode::Smooth, NormalMode::Footprint { radius: 0.05 }] {
        let spray = NozzleSettings { normal, ..NozzleSettings::default() };
        let nozzle = nozzle_command(&chart, [0.7, 0.3], &spray).unwrap();
        let expected = [0.7, -spray.stand_off(), 0.3];
        assert!(nozzle.position.coords.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9));
        assert!((nozzle.direction.y - 1.0).abs() < 1e-12);
        assert!((nozzle.point.y).abs() < 1e-12 && (nozzle.normal.y + 1.0).abs() < 1e-12);
    }
    let outside = nozzle_command(&chart, [2.5, 0.3], &NozzleSettings::default()).unwrap_err();
    assert_eq!(outside, Error::OutsideChart { u: 2.5, v: 0.3 });
    let flat_cone = NozzleSettings { half_angle: 2.0, ..NozzleSettings::default() };
    assert!(matches!(nozzle_command(&chart, [0.7, 0.3], &flat_cone), Err(Error::Setting { name: "half_angle", .. })));
    let no_spot = NozzleSettings { sigma: f64::NAN, ..NozzleSettings::default() };
    assert!(matches!(nozzle_command(&chart, [0.7, 0.3], &no_spot), Err(Error::Setting { name: "sigma", .. })));
}

#[test]
fn smooth_normals_do_not_jump_and_footprints_see_through_corrugation() {
    // Part of a sphere: the smooth normal is nearly radial; walking along the chart it never jumps like the faces do.
    let ball = chart(20, 20, |s, t| {
        let (a, b) = (1.2 * (s - 0.5), 1.2 * (t - 0.5));
        [a.sin() * b.cos(), -a.cos() * b.cos(), b.sin()]
    });
    let mut last: Option<(Vector3<f64>, Vector3<f64>)> = None;
    let (mut jump_smooth, mut jump_face) = (0.0_f64, 0.0_f64);
    for i in 0..4000 {
        let uv = [ball.width() * (0.2 + 0.6 * f64::from(i) / 4000.0), 0.52 * ball.height()];
        let at = ball.locate(uv).unwrap();
        let radial = ball.point(at).coords.normalize();
        assert!(ball.smooth_normal(at).dot(&radial) > 0.9995);
        let now = (ball.smooth_normal(at).into_inner(), ball.face_normal(at.face).into_inner());
        if let Some((smooth, face)) = last {
            jump_smooth = jump_smooth.max((now.0 - smooth).norm());
            jump_face = jump_face.max((now.1 - face).norm());
        }
        last = Some(now);
    }
    assert!(jump_smooth < 1e-3 && jump_face > 1e-2, "smooth {jump_smooth}, face {jump_face}");

    // A sheet folded every 1 cm by +-45 degrees: faces look left or right, the footprint looks straight ahead.
    let roof = chart(80, 4, |s, t| {
        let i = (80.0 * s).round();
        [0.01 * i, if i % 2.0 == 0.0 { 0.0 } else { -0.01 }, 0.5 * t]
    });
    let at = roof.locate([0.5 * roof.width(), 0.5 * roof.height()]).unwrap();
    assert!((roof.face_normal(at.face).y + 0.5_f64.sqrt()).abs() < 1e-6);
    assert!(roof.footprint_normal(at, 0.1).y < -0.99);
}
